//! A lock on a whole file, by the system's `flock`. The standard library's own locks do nothing on Android before Rust 1.98: each
//! call is an error there (rust-lang/rust#148325).

use std::{fs::File, io};

use rustix::{
    fs::{FlockOperation, flock},
    io::Errno,
};

/// A lock that is held until this is dropped, at the latest until the process ends. It is advisory: the file can still be read and
/// written without it.
#[derive(Debug)]
pub(crate) struct FileLock(#[expect(dead_code, reason = "held, never read")] File);

impl FileLock {
    /// The only lock of the file; nothing where another one is held.
    pub(crate) fn exclusive(file: File) -> io::Result<Option<Self>> {
        Self::of(file, FlockOperation::NonBlockingLockExclusive)
    }

    /// One of several shared locks; nothing where an exclusive one is held.
    pub(crate) fn shared(file: File) -> io::Result<Option<Self>> {
        Self::of(file, FlockOperation::NonBlockingLockShared)
    }

    fn of(file: File, operation: FlockOperation) -> io::Result<Option<Self>> {
        loop {
            return match flock(&file, operation) {
                Ok(()) => Ok(Some(Self(file))),
                Err(Errno::WOULDBLOCK) => Ok(None),
                Err(Errno::INTR) => continue,
                Err(error) => Err(error.into()),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exclusive_lock_excludes_all_others_and_shared_ones_only_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lock");
        let open = || {
            let mut options = File::options();
            let options = options.create(true).truncate(false).write(true);
            options.open(&path).expect("a file")
        };
        let exclusive = || FileLock::exclusive(open()).expect("the system can lock");
        let shared = || FileLock::shared(open()).expect("the system can lock");
        let only = exclusive().expect("it is free");
        assert!(exclusive().is_none(), "there is one already");
        assert!(shared().is_none(), "nor beside it");
        drop(only);
        let (one, other) = (shared(), shared());
        assert!(one.is_some() && other.is_some(), "two share it");
        assert!(exclusive().is_none(), "while they do");
        drop(one);
        assert!(exclusive().is_none(), "while one of them does");
        drop(other);
        assert!(exclusive().is_some(), "all of them are gone");
    }
}
