//! Graphs compiled for an NPU, kept in a folder: compiling takes ten seconds, loading two.
//!
//! An entry's name is the hash of everything that went into it, so an entry is never out of date, only unused. It opens
//! with its key and its content's hash; what is damaged, not ours, or another user may have written is deleted and made again.

use crate::{QnnTarget, RuntimeError};
use sha2::{Digest, Sha256};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

const MAGIC: &str = "mon3tr compiled graph 1\n";
const DIGEST: usize = 64;
/// Magic line, key line, digest line.
const HEADER: usize = MAGIC.len() + 2 * (DIGEST + 1);

/// Where the compiled form of one graph for one target belongs.
#[derive(Debug)]
pub(crate) struct Entry {
    folder: PathBuf,
    key: String,
}

impl Entry {
    /// The entry in `folder` for `model` on `target`, compiled by these versions.
    pub(crate) fn new(
        folder: &Path,
        model: &[u8],
        target: QnnTarget,
        runtime: &str,
        plugin: &str,
    ) -> Self {
        let mut key = Sha256::new();
        key.update(Sha256::digest(model));
        let (soc, arch) = (target.soc_model(), target.htp_arch());
        key.update(format!("{target}\n{soc}\n{arch}\n{runtime}\n{plugin}\n"));
        Self {
            folder: folder.to_path_buf(),
            key: hexadecimal(&key.finalize()),
        }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.join(format!("{}.context", self.key))
    }

    /// The compiled graph, if there is one that is whole and that nobody but this user can have written. Whatever else is there is deleted.
    pub(crate) fn load(&self) -> Option<Vec<u8>> {
        let mut bytes = match read_own(&self.path()) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == ErrorKind::NotFound => return None,
            Err(e) => {
                self.discard(&format!("cannot be read ({e})"));
                return None;
            }
        };
        let content = bytes.get(HEADER..).unwrap_or_default();
        if bytes.get(..HEADER) != Some(self.header(content).as_bytes()) {
            self.discard("is damaged, or another program's");
            return None;
        }
        bytes.drain(..HEADER);
        Some(bytes)
    }

    /// Deletes the entry and says so; it will be made again.
    pub(crate) fn discard(&self, why: &str) {
        let path = self.path();
        log::warn!(
            "the compiled graph {} {why}: deleting it and compiling again",
            path.display()
        );
        if let Err(e) = std::fs::remove_file(&path) {
            log::warn!("cannot delete {}: {e}", path.display());
        }
    }

    /// Keeps `content`: the entry is whole or, on an error, absent.
    pub(crate) fn save(&self, content: &[u8]) -> Result<(), RuntimeError> {
        let failed = |source| RuntimeError::Cache {
            path: self.path(),
            source,
        };
        let mut file = tempfile::NamedTempFile::new_in(&self.folder).map_err(failed)?;
        file.write_all(self.header(content).as_bytes())
            .and_then(|()| file.write_all(content))
            .and_then(|()| file.as_file().sync_all())
            .map_err(failed)?;
        file.persist(self.path()).map_err(|e| failed(e.error))?;
        Ok(())
    }

    fn header(&self, content: &[u8]) -> String {
        let digest = hexadecimal(&Sha256::digest(content));
        format!("{MAGIC}{}\n{digest}\n", self.key)
    }
}

/// Reads a file that only this user can have written: an NPU's driver runs what it holds.
fn read_own(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = std::fs::File::open(path)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let found = file.metadata()?;
        let is_own = found.uid() == rustix::process::geteuid().as_raw();
        if !is_own || found.mode() & 0o022 != 0 {
            return Err(std::io::Error::other("other users may write it"));
        }
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Lower-case hexadecimal.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(folder: &Path) -> Entry {
        Entry::new(folder, b"model", QnnTarget::SXR2230P, "1.31.1", "plugin")
    }

    #[test]
    fn a_kept_graph_is_read_back_and_a_flipped_byte_deletes_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let entry = entry(folder.path());
        assert_eq!(entry.load(), None, "nothing yet");
        let content: Vec<u8> = (0..=255).collect();
        entry.save(&content).expect("a writable folder");
        assert_eq!(entry.load(), Some(content.clone()), "as it was");
        let whole = std::fs::read(entry.path()).expect("the file");
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            std::fs::write(entry.path(), &damaged).expect("a writable folder");
            assert_eq!(entry.load(), None, "byte {at}");
            assert!(!entry.path().exists(), "byte {at}: it stayed");
        }
        std::fs::write(entry.path(), "short").expect("a writable folder");
        assert_eq!(entry.load(), None, "cut short");
        let left = std::fs::read_dir(folder.path())
            .expect("the folder")
            .count();
        assert_eq!(left, 0, "temporary files");
    }

    #[cfg(unix)]
    #[test]
    fn an_entry_that_others_may_write_is_not_taken() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let entry = entry(folder.path());
        for (mode, taken) in [(0o600, true), (0o644, true), (0o664, false), (0o646, false)] {
            entry.save(b"content").expect("a writable folder");
            let permissions = std::fs::Permissions::from_mode(mode);
            std::fs::set_permissions(entry.path(), permissions).expect("one's own");
            assert_eq!(entry.load().is_some(), taken, "mode {mode:o}");
            assert_eq!(entry.path().exists(), taken, "mode {mode:o}: what is left");
        }
        // One that another user owns: as root, which may give files away.
        if rustix::process::geteuid().is_root() {
            entry.save(b"content").expect("a writable folder");
            std::os::unix::fs::chown(entry.path(), Some(1), None).expect("root may");
            assert_eq!(entry.load(), None, "another user's");
        }
    }

    #[test]
    fn the_key_depends_on_every_input() {
        let folder = Path::new("x");
        let target = QnnTarget::SXR2230P;
        let paths = [
            Entry::new(folder, b"model", target, "1.31.1", "plugin").path(),
            Entry::new(folder, b"other", target, "1.31.1", "plugin").path(),
            Entry::new(folder, b"model", target, "1.31.2", "plugin").path(),
            Entry::new(folder, b"model", target, "1.31.1", "newer").path(),
        ];
        for (at, path) in paths.iter().enumerate() {
            assert!(!paths[..at].contains(path), "{at} is not its own");
        }
    }

    #[test]
    fn an_entry_under_another_key_is_not_taken() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let ours = entry(folder.path());
        let theirs = Entry::new(folder.path(), b"other", QnnTarget::SXR2230P, "", "");
        theirs.save(b"content").expect("a writable folder");
        std::fs::rename(theirs.path(), ours.path()).expect("it moves");
        assert_eq!(ours.load(), None, "the key within is another");
    }
}
