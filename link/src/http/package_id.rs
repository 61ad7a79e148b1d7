//! What a package is called: the SHA-256 of its bytes.

use std::{fmt, fs::File, io, io::Read, path::Path, str::FromStr};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::HttpError;

const READ: usize = 1 << 20;

/// A package's SHA-256, written as 64 hexadecimal digits in lower case.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct PackageId([u8; 32]);

impl PackageId {
    /// The hash of these bytes.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// The hash of a file. Reads all of it: not for an async task.
    ///
    /// # Errors
    /// [`HttpError::File`] if it cannot be read.
    pub fn of_file(path: &Path) -> Result<Self, HttpError> {
        let hash = || {
            let mut hash = Sha256::new();
            hash_reader(&mut hash, &mut File::open(path)?)?;
            Ok(Self::finish(hash))
        };
        hash().map_err(|source| HttpError::File {
            path: path.to_owned(),
            source,
        })
    }

    /// The 32 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    pub(super) fn finish(hash: Sha256) -> Self {
        Self(hash.finalize().into())
    }
}

/// Feeds all that is left of a reader, and counts it.
pub(super) fn hash_reader(hash: &mut Sha256, reader: &mut impl Read) -> io::Result<u64> {
    let mut buffer = vec![0; READ];
    let mut total = 0;
    loop {
        let got = match reader.read(&mut buffer) {
            Ok(0) => return Ok(total),
            Ok(got) => got,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        hash.update(buffer.get(..got).unwrap_or_default());
        total += got as u64;
    }
}

impl fmt::Display for PackageId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for PackageId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PackageId({self})")
    }
}

impl FromStr for PackageId {
    type Err = HttpError;

    fn from_str(text: &str) -> Result<Self, HttpError> {
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Ok(byte - b'0'),
            b'a'..=b'f' => Ok(byte - b'a' + 10),
            _ => Err(HttpError::PackageId),
        };
        let (pairs, []) = text.as_bytes().as_chunks::<2>() else {
            return Err(HttpError::PackageId);
        };
        let pairs: &[[u8; 2]; 32] = pairs.try_into().map_err(|_| HttpError::PackageId)?;
        let mut id = [0; 32];
        for (byte, &[high, low]) in id.iter_mut().zip(pairs) {
            *byte = digit(high)? << 4 | digit(low)?;
        }
        Ok(Self(id))
    }
}

impl TryFrom<String> for PackageId {
    type Error = HttpError;

    fn try_from(text: String) -> Result<Self, HttpError> {
        text.parse()
    }
}

impl From<PackageId> for String {
    fn from(id: PackageId) -> Self {
        id.to_string()
    }
}
