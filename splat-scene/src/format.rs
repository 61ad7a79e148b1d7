//! The file formats.

use std::fmt;

use crate::axes::Axes;

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
    /// Niantic's packed format of the given version, in gzip or Zstandard streams.
    Spz {
        /// The header's version: 2, 3 or 4.
        version: u32,
    },
    /// `PlayCanvas`' format of images and a `meta.json`, in a zip or a folder.
    Sog {
        /// The version that `meta.json` states: 2, or 1 where it states none.
        version: u32,
    },
    /// No file: assembled in memory.
    Memory,
}

impl Format {
    /// The axes that files of the format have, unless they state others.
    pub(crate) fn axes(self) -> Axes {
        match self {
            Self::Ply | Self::CompressedPly | Self::Splat | Self::Sog { .. } => Axes::COLMAP,
            Self::Spz { .. } | Self::Memory => Axes::HOUSE,
        }
    }
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
            // Before its description is read.
            Self::Sog { version: 0 } => out.write_str("SOG"),
            Self::Sog { version } => write!(out, "SOG version {version}"),
            Self::Memory => out.write_str("assembled in memory"),
        }
    }
}
