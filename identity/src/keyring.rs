//! What a machine's user is known by: one's own key, and the permits of others' avatars.

use crate::{Identity, IdentityError, LineFile, Permit};
use std::path::{Path, PathBuf};

/// Bytes of the permits' file, at most: some 300 of them.
const MOST: u64 = 64 << 10;

/// One's own key and the permits, each in a file of its own.
#[derive(Debug, Clone)]
pub struct Keyring {
    key: PathBuf,
    permits: LineFile,
    identity: Identity,
}

impl Keyring {
    /// With one's own key in the file `key`, made now if there is none, and permits in `permits`, a line each.
    ///
    /// # Errors
    /// If the key cannot be read or made.
    pub fn open(key: PathBuf, permits: PathBuf) -> Result<Self, IdentityError> {
        let identity = Identity::open(&key)?;
        Ok(Self {
            key,
            permits: LineFile::new(permits, MOST),
            identity,
        })
    }

    /// One's own key.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The file of one's own key.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.key
    }

    /// The permits; none where there is no file.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn permits(&self) -> Result<Vec<Permit>, IdentityError> {
        let lines = self.permits.read();
        let lines = lines.map_err(|source| self.failed("read", source))?;
        let lines = lines.iter().filter(|line| !line.trim().is_empty());
        lines.map(|line| line.parse()).collect()
    }

    /// Keeps a permit, in the place of a former one by the same owner.
    ///
    /// # Errors
    /// If it cannot be kept.
    pub fn accept(&self, permit: &Permit) -> Result<(), IdentityError> {
        let mut permits = self.permits()?;
        permits.retain(|other| (other.owner(), other.key()) != (permit.owner(), permit.key()));
        permits.push(*permit);
        let written = self.permits.write(&permits);
        written.map_err(|source| self.failed("write", source))
    }

    fn failed(&self, action: &'static str, source: std::io::Error) -> IdentityError {
        IdentityError::File {
            action,
            path: self.permits.path().to_owned(),
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permit_is_kept_once_an_owner() {
        let folder = tempfile::tempdir().expect("a folder");
        let [key, permits] = ["key", "permits"].map(|name| folder.path().join(name));
        let ring = Keyring::open(key, permits.clone()).expect("a keyring");
        assert!(ring.permits().expect("no file").is_empty());
        let [ada, bob] = [1, 2].map(|seed| Identity::from_seed(&[seed; 32]).expect("a key"));
        let permit = |owner, until| Permit::new(owner, ring.identity().public(), until);
        for permit in [permit(&ada, 5), permit(&bob, 6), permit(&ada, 7)] {
            ring.accept(&permit).expect("kept");
        }
        let kept = ring.permits().expect("two");
        assert_eq!(kept, [permit(&bob, 6), permit(&ada, 7)]);
        std::fs::write(&permits, "something else\n").expect("written");
        assert!(ring.permits().is_err(), "it is told, not passed over");
        assert!(ring.accept(&permit(&ada, 8)).is_err(), "and not lost");
    }
}
