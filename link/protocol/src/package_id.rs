//! A package's name: the SHA-256 of its bytes.

use std::{fmt, io, io::Read, str::FromStr};

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::ProtocolError;

/// Bytes read at once.
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
    /// Adds the next piece.
    pub fn update(&mut self, piece: &[u8]) {
        self.0.update(piece);
    }

    /// Adds the rest of a reader and returns how many bytes that was. Blocks: not for an async task.
    ///
    /// # Errors
    /// Those of the reader; the bytes before are added.
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

    /// The hash of all pieces.
    #[must_use]
    pub fn finish(self) -> PackageId {
        PackageId(self.0.finalize().into())
    }
}

impl fmt::Display for PackageId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        HEXLOWER.encode_display(&self.0).fmt(f)
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
        let mut id = [0; 32];
        if text.len() != 2 * id.len() {
            return Err(ProtocolError::PackageId);
        }
        HEXLOWER
            .decode_mut(text.as_bytes(), &mut id)
            .map_err(|_| ProtocolError::PackageId)?;
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
