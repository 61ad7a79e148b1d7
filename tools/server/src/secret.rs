//! The server's secret: it authenticates tokens. Instances behind one balancer share one. While it is being replaced,
//! the one before authenticates those that it has signed.

use crate::ServerError;
use crate::id::{from_hex, random_bytes};
use data_encoding::HEXLOWER;
use std::fmt;
use std::io::{ErrorKind, Write};
use std::path::Path;

/// 32 random bytes that only the server knows, and those that were in their place before.
#[derive(Clone)]
pub struct Secret {
    key: [u8; 32],
    previous: Option<[u8; 32]>,
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

impl Secret {
    fn of(key: [u8; 32]) -> Self {
        Self {
            key,
            previous: None,
        }
    }

    /// This one, in place of `previous`, whose tokens hold until they expire.
    #[must_use]
    pub fn after(self, previous: &Self) -> Self {
        Self {
            previous: Some(previous.key),
            ..self
        }
    }

    /// A new one that is not stored: its tokens end with the process.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn random() -> Result<Self, ServerError> {
        random_bytes().map(Self::of)
    }

    /// The secret in the file `path`, as [`Self::load_or_create`] reads it; nothing if there is no file.
    ///
    /// # Errors
    /// If the file cannot be read, or holds something else.
    pub fn load(path: &Path) -> Result<Option<Self>, ServerError> {
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(path, &text).map(Some),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) if e.kind() == ErrorKind::InvalidData => Self::parse(path, "").map(Some),
            Err(source) => Err(ServerError::SecretFile {
                action: "read",
                path: path.to_path_buf(),
                source,
            }),
        }
    }

    /// The secret in the file `path` (64 hexadecimal digits), which is made, readable by its owner alone, if there is
    /// none. Of two servers that make it at once, both get the same.
    ///
    /// # Errors
    /// If the file can be neither read nor made, or holds something else.
    pub fn load_or_create(path: &Path) -> Result<Self, ServerError> {
        let failed = |action| {
            move |source| ServerError::SecretFile {
                action,
                path: path.to_path_buf(),
                source,
            }
        };
        if let Some(secret) = Self::load(path)? {
            return Ok(secret);
        }
        let secret = Self::random()?;
        let text = HEXLOWER.encode(&secret.key) + "\n";
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(folder).map_err(failed("create"))?;
        // Temporary files have mode 0600, and appear under the final name only when whole.
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed("create"))?;
        file.write_all(text.as_bytes())
            .and_then(|()| file.as_file().sync_all())
            .map_err(failed("create"))?;
        match file.persist_noclobber(path) {
            Ok(_) => Ok(secret),
            Err(e) if e.error.kind() == ErrorKind::AlreadyExists => {
                let text = std::fs::read_to_string(path).map_err(failed("read"))?;
                Self::parse(path, &text)
            }
            Err(e) => Err(failed("create")(e.error)),
        }
    }

    fn parse(path: &Path, text: &str) -> Result<Self, ServerError> {
        from_hex(text.trim())
            .map(Self::of)
            .ok_or_else(|| ServerError::SecretDamaged {
                path: path.to_path_buf(),
            })
    }

    /// The key that signs, or the one before, where there was one.
    pub(crate) fn key(&self, previous: bool) -> [u8; 32] {
        self.previous.filter(|_| previous).unwrap_or(self.key)
    }

    pub(crate) fn previous(&self) -> Option<&[u8; 32]> {
        self.previous.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_is_made_once_and_only_its_owner_may_read_it()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("below/secret");
        let first = Secret::load_or_create(&path)?;
        assert_eq!(first.key, Secret::load_or_create(&path)?.key, "kept");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(&path)?.permissions().mode() & 0o777;
            assert_eq!(mode, 0o600, "mode {mode:o}");
        }
        std::fs::write(&path, "not a secret")?;
        let error = Secret::load_or_create(&path).err().ok_or("accepted")?;
        assert!(error.to_string().contains("below/secret"), "{error}");
        assert_eq!(format!("{first:?}"), "Secret(..)", "not in a log");
        Ok(())
    }
}
