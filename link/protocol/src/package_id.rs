//! What a package is called: the SHA-256 of its bytes.

use std::{fmt, fs::File, io, io::Read, path::Path, str::FromStr};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::ProtocolError;

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
    /// [`ProtocolError::File`] if it cannot be read.
    pub fn of_file(path: &Path) -> Result<Self, ProtocolError> {
        let hash = || {
            let mut hasher = PackageHasher::default();
            hasher.read_from(&mut File::open(path)?)?;
            Ok(hasher.finish())
        };
        hash().map_err(|source| ProtocolError::File {
            path: path.to_owned(),
            source,
        })
    }

    /// The 32 bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

/// Hashes a package that comes in pieces.
#[derive(Debug, Clone, Default)]
pub struct PackageHasher(Sha256);

impl PackageHasher {
    /// Takes the next piece.
    pub fn update(&mut self, piece: &[u8]) {
        self.0.update(piece);
    }

    /// Takes all that is left of a reader, and counts its bytes. Blocks: not for an async task.
    ///
    /// # Errors
    /// Those of the reader; what it gave before is hashed.
    pub fn read_from(&mut self, reader: &mut impl Read) -> io::Result<u64> {
        let mut buffer = vec![0; READ];
        let mut total = 0;
        loop {
            let got = match reader.read(&mut buffer) {
                Ok(0) => return Ok(total),
                Ok(got) => got,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            self.update(buffer.get(..got).unwrap_or_default());
            total += got as u64;
        }
    }

    /// The hash of all that was taken.
    #[must_use]
    pub fn finish(self) -> PackageId {
        PackageId(self.0.finalize().into())
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
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Ok(byte - b'0'),
            b'a'..=b'f' => Ok(byte - b'a' + 10),
            _ => Err(ProtocolError::PackageId),
        };
        let (pairs, []) = text.as_bytes().as_chunks::<2>() else {
            return Err(ProtocolError::PackageId);
        };
        let pairs: &[[u8; 2]; 32] = pairs.try_into().map_err(|_| ProtocolError::PackageId)?;
        let mut id = [0; 32];
        for (byte, &[high, low]) in id.iter_mut().zip(pairs) {
            *byte = digit(high)? << 4 | digit(low)?;
        }
        Ok(Self(id))
    }
}

impl TryFrom<String> for PackageId {
    type Error = ProtocolError;

    fn try_from(text: String) -> Result<Self, ProtocolError> {
        text.parse()
    }
}

impl From<PackageId> for String {
    fn from(id: PackageId) -> Self {
        id.to_string()
    }
}
