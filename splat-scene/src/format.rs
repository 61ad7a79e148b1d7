//! The file formats, and telling them apart by content.

use std::fmt;
use std::path::Path;

use crate::source::Source;
use crate::{SceneError, splat};

/// Where a scene's data came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// PLY as the 3DGS trainer writes it: one 32-bit property for each attribute.
    Ply,
    /// PLY of packed 32-bit words in chunks of 256, as PlayCanvas and `SuperSplat` write it.
    CompressedPly,
    /// Records of 32 bytes without a header, as antimatter15's viewer reads them.
    Splat,
    /// Niantic's packed format of the given version, in gzip.
    Spz {
        /// The header's version: 2 or 3.
        version: u32,
    },
    /// No file: assembled in memory.
    Memory,
}

impl fmt::Display for Format {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ply => out.write_str("3DGS PLY"),
            Self::CompressedPly => out.write_str("compressed PLY"),
            Self::Splat => out.write_str(".splat"),
            // Before its header is read.
            Self::Spz { version: 0 } => out.write_str(".spz"),
            Self::Spz { version } => write!(out, ".spz version {version}"),
            Self::Memory => out.write_str("assembled in memory"),
        }
    }
}

/// Which reader a file is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reader {
    Ply,
    Splat,
    Spz,
}

pub(crate) fn detect(source: &Source<'_>) -> Result<Reader, SceneError> {
    let bytes = source.bytes;
    if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n") {
        return Ok(Reader::Ply);
    }
    // An .spz is a gzip stream; some tools also leave the payload bare.
    if bytes.starts_with(&[0x1f, 0x8b]) || bytes.starts_with(b"NGSP") {
        return Ok(Reader::Spz);
    }
    let named_splat = Path::new(source.name)
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("splat"));
    splat::recognise(source, named_splat)?;
    Ok(Reader::Splat)
}
