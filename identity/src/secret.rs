//! One's own key.

use crate::{IdentityError, PublicKey, Purpose, Signature, open_private};
use data_encoding::BASE64URL_NOPAD;
use ring::signature::{Ed25519KeyPair, KeyPair};
use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// Bytes of the seed that an Ed25519 key is made of: the secret.
const SEED_BYTES: usize = 32;

/// How the file of a key begins; the seed follows, in base64url.
const HEAD: &str = "mon3tr-key-1 ";

/// The longest file that is read.
const MOST_BYTES: u64 = 256;

/// One's own key, secret part and all. Clones share it.
#[derive(Clone)]
pub struct Identity {
    pair: Arc<Ed25519KeyPair>,
    public: PublicKey,
}

impl Identity {
    /// A new key, which is nowhere but in memory.
    ///
    /// # Errors
    /// [`IdentityError::Random`].
    pub fn generate() -> Result<Self, IdentityError> {
        Self::from_seed(&new_seed()?)
    }

    /// The key in the file `path`; where there is no such file, a new key, kept there for its owner's eyes only (mode 0600). Two programs that
    /// start at once get the same key.
    ///
    /// # Errors
    /// If the file cannot be read or written, other users may read it, or it holds something else.
    pub fn open(path: &Path) -> Result<Self, IdentityError> {
        match Self::read(path) {
            Err(IdentityError::File { source, .. }) if source.kind() == ErrorKind::NotFound => {
                create(path)?;
                Self::read(path)
            }
            read => read,
        }
    }

    fn read(path: &Path) -> Result<Self, IdentityError> {
        let mut text = String::new();
        (open_private(path)?.take(MOST_BYTES))
            .read_to_string(&mut text)
            .map_err(failed("read", path))?;
        let seed = text.trim_end().strip_prefix(HEAD);
        let seed = seed.and_then(|seed| BASE64URL_NOPAD.decode(seed.as_bytes()).ok());
        let seed = seed.and_then(|seed| seed.try_into().ok());
        let no_key = || IdentityError::NoKey {
            path: path.to_owned(),
        };
        Self::from_seed(&seed.ok_or_else(no_key)?).map_err(|_| no_key())
    }

    /// The key that is made of this seed.
    ///
    /// # Errors
    /// If the cryptography library refuses it.
    pub fn from_seed(seed: &[u8; SEED_BYTES]) -> Result<Self, IdentityError> {
        let wrong = |_| IdentityError::Malformed("the seed of a key");
        let pair = Ed25519KeyPair::from_seed_unchecked(seed).map_err(wrong)?;
        let public = PublicKey::of(pair.public_key().as_ref())?;
        let pair = Arc::new(pair);
        Ok(Self { pair, public })
    }

    /// The public part.
    #[must_use]
    pub fn public(&self) -> PublicKey {
        self.public
    }

    /// `KEY SIGNATURE`: this key, and its signature of `text` for `purpose`.
    #[must_use]
    pub fn sign_as_text(&self, purpose: Purpose, text: &[u8]) -> String {
        format!("{} {}", self.public, self.sign(purpose, text))
    }

    /// Signs `text` for `purpose`; the same text gets the same signature.
    #[must_use]
    pub fn sign(&self, purpose: Purpose, text: &[u8]) -> Signature {
        let signed = self.pair.sign(&purpose.text(text));
        let mut bytes = [0; _];
        for (byte, signed) in bytes.iter_mut().zip(signed.as_ref()) {
            *byte = *signed;
        }
        Signature::of_array(bytes)
    }
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Identity").field(&self.public).finish()
    }
}

fn new_seed() -> Result<[u8; SEED_BYTES], IdentityError> {
    let mut seed = [0; SEED_BYTES];
    getrandom::fill(&mut seed)?;
    Ok(seed)
}

/// Writes a new key to `path`, unless another program does so at this moment.
fn create(path: &Path) -> Result<(), IdentityError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(failed("make the folder of", path))?;
    // Made with mode 0600.
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed("write", path))?;
    let text = format!("{HEAD}{}\n", BASE64URL_NOPAD.encode(&new_seed()?));
    file.write_all(text.as_bytes())
        .and_then(|()| file.as_file().sync_all())
        .map_err(failed("write", path))?;
    match file.persist_noclobber(path) {
        Err(error) if error.error.kind() != ErrorKind::AlreadyExists => {
            Err(failed("write", path)(error.error))
        }
        _ => Ok(()),
    }
}

fn failed<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl Fn(std::io::Error) -> IdentityError + 'a {
    move |source| IdentityError::File {
        action,
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8032, section 7.1, test 1: an empty message; and SHA-512 of the seed is not what is stored.
    #[test]
    fn the_public_key_is_that_of_the_standard() {
        let seed = data_encoding::HEXLOWER
            .decode(b"9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
            .expect("hexadecimal");
        let seed: [u8; 32] = seed.try_into().expect("32 bytes");
        let identity = Identity::from_seed(&seed).expect("a key");
        let public = data_encoding::HEXLOWER.encode(identity.public().bytes());
        assert_eq!(
            public,
            "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"
        );
    }

    #[test]
    fn a_key_is_made_once_and_is_its_owners_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("made/key");
        let first = Identity::open(&path).expect("a new key");
        assert_eq!(first.public(), Identity::open(&path).expect("it").public());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(&path).expect("the file").permissions();
            assert_eq!(mode.mode() & 0o777, 0o600);
        }
        assert!(!format!("{first:?}").contains(&std::fs::read_to_string(&path).expect("text")));
    }

    #[test]
    fn programs_that_start_at_once_get_the_same_key() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        let keys: Vec<PublicKey> = std::thread::scope(|scope| {
            let open = || Identity::open(&path).expect("a key").public();
            let opening: Vec<_> = (0..8).map(|_| scope.spawn(open)).collect();
            opening
                .into_iter()
                .map(|it| it.join().expect("no panic"))
                .collect()
        });
        assert!(keys.iter().all(|key| key == &keys[0]));
    }

    #[test]
    fn a_file_with_something_else_is_left_as_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        Identity::open(&path).expect("a new key, in a file with its mode");
        for text in ["", "mon3tr-key-1 short", "-----BEGIN PRIVATE KEY-----"] {
            std::fs::write(&path, text).expect("written");
            let refused = Identity::open(&path).map(|it| it.public());
            assert!(matches!(refused, Err(IdentityError::NoKey { .. })));
            assert_eq!(std::fs::read_to_string(&path).expect("text"), text);
        }
    }
}
