//! What a machine's user is known by, and whom they trust: one's own key, the permits of others' avatars, and the keys whose packages may bring compiled
//! code.

use crate::{Identity, IdentityError, LineFile, Permit, PublicKey, open_private};
use std::fmt::Display;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Bytes of the permits' file and of the trusted keys', at most: some 300 permits, some 1,400 keys.
const MOST: u64 = 64 << 10;

/// One's own key, the permits and the trusted keys, each in a file of its own.
#[derive(Debug, Clone)]
pub struct Keyring {
    key: PathBuf,
    permits: LineFile,
    trusted: LineFile,
    identity: Identity,
}

impl Keyring {
    /// With one's own key in the file `key`, made now if there is none, permits in `permits` and trusted keys in `trusted`, a line each.
    ///
    /// # Errors
    /// If the key cannot be read or made.
    pub fn open(key: PathBuf, permits: PathBuf, trusted: PathBuf) -> Result<Self, IdentityError> {
        let identity = Identity::open(&key)?;
        Ok(Self {
            key,
            permits: LineFile::new(permits, MOST),
            trusted: LineFile::new(trusted, MOST),
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
    /// If they cannot be read, or others may read or write the file.
    pub fn permits(&self) -> Result<Vec<Permit>, IdentityError> {
        entries(&self.permits)
    }

    /// Keeps a permit, in the place of a former one by the same owner.
    ///
    /// # Errors
    /// If it cannot be kept.
    pub fn accept(&self, permit: &Permit) -> Result<(), IdentityError> {
        let mut permits = self.permits()?;
        permits.retain(|other| (other.owner(), other.key()) != (permit.owner(), permit.key()));
        permits.push(*permit);
        write(&self.permits, &permits)
    }

    /// The other keys whose packages may bring compiled code; none where there is no file.
    ///
    /// # Errors
    /// If they cannot be read, or others may read or write the file.
    pub fn trusted(&self) -> Result<Vec<PublicKey>, IdentityError> {
        entries(&self.trusted)
    }

    /// The file of the trusted keys, which need not be there.
    #[must_use]
    pub fn trusted_file(&self) -> &Path {
        self.trusted.path()
    }

    /// Trusts `key` from now on.
    ///
    /// # Errors
    /// If that cannot be kept.
    pub fn trust(&self, key: PublicKey) -> Result<(), IdentityError> {
        let mut trusted = self.trusted()?;
        if !trusted.contains(&key) {
            trusted.push(key);
        }
        write(&self.trusted, &trusted)
    }

    /// Trusts `key` no longer; gives whether it was trusted.
    ///
    /// # Errors
    /// If that cannot be kept.
    pub fn distrust(&self, key: PublicKey) -> Result<bool, IdentityError> {
        let mut trusted = self.trusted()?;
        let before = trusted.len();
        trusted.retain(|other| *other != key);
        write(&self.trusted, &trusted)?;
        Ok(trusted.len() < before)
    }
}

/// What the lines of `file` say.
fn entries<T: FromStr<Err = IdentityError>>(file: &LineFile) -> Result<Vec<T>, IdentityError> {
    match open_private(file.path()) {
        Err(IdentityError::File { source, .. }) if source.kind() == ErrorKind::NotFound => {
            return Ok(Vec::new());
        }
        opened => opened?,
    };
    let lines = file.read().map_err(failed("read", file))?;
    let lines = lines.iter().map(|line| line.trim());
    let lines = lines.filter(|line| !line.is_empty());
    lines.map(str::parse).collect()
}

fn write(file: &LineFile, entries: &[impl Display]) -> Result<(), IdentityError> {
    file.write(entries).map_err(failed("write", file))
}

fn failed(action: &'static str, file: &LineFile) -> impl FnOnce(std::io::Error) -> IdentityError {
    let path = file.path().to_owned();
    move |source| IdentityError::File {
        action,
        path,
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permit_is_kept_once_an_owner() {
        let folder = tempfile::tempdir().expect("a folder");
        let (ring, permits) = (open(&folder), folder.path().join("permits"));
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

    #[test]
    fn a_key_is_trusted_until_it_is_taken_off_the_list() {
        let folder = tempfile::tempdir().expect("a folder");
        let ring = open(&folder);
        assert!(ring.trusted().expect("no file").is_empty());
        let [ada, bob] = [1, 2].map(|seed| Identity::from_seed(&[seed; 32]).expect("a key"));
        let [ada, bob] = [ada.public(), bob.public()];
        for key in [ada, bob, ada] {
            ring.trust(key).expect("kept");
        }
        assert_eq!(open(&folder).trusted().expect("two"), [ada, bob]);
        assert!(ring.distrust(ada).expect("kept"), "it was trusted");
        assert!(!ring.distrust(ada).expect("kept"), "it no longer was");
        assert_eq!(ring.trusted().expect("one"), [bob]);
        assert!(ring.permits().expect("none").is_empty(), "another list");
        std::fs::write(folder.path().join("trusted"), "anyone\n").expect("written");
        assert!(ring.trusted().is_err(), "it is told, not passed over");
        assert!(ring.trust(ada).is_err(), "and not lost");
    }

    #[cfg(unix)]
    #[test]
    fn permits_and_trusted_keys_that_others_may_change_are_refused() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let ring = open(&folder);
        ring.trust(ring.identity().public()).expect("kept");
        let file = folder.path().join("trusted");
        let open_to_others = std::fs::Permissions::from_mode(0o666);
        std::fs::set_permissions(&file, open_to_others.clone()).expect("set");
        assert!(matches!(
            ring.trusted(),
            Err(IdentityError::NotPrivate { .. })
        ));
        std::fs::copy(&file, folder.path().join("permits")).expect("copied");
        assert!(matches!(
            ring.permits(),
            Err(IdentityError::NotPrivate { .. })
        ));
        std::fs::set_permissions(folder.path().join("key"), open_to_others).expect("set");
        let files = ["key", "permits", "trusted"].map(|name| folder.path().join(name));
        let [key, permits, trusted] = files;
        let refused = Keyring::open(key, permits, trusted);
        assert!(matches!(refused, Err(IdentityError::NotPrivate { .. })));
    }

    fn open(folder: &tempfile::TempDir) -> Keyring {
        let [key, permits, trusted] =
            ["key", "permits", "trusted"].map(|name| folder.path().join(name));
        Keyring::open(key, permits, trusted).expect("a keyring")
    }
}
