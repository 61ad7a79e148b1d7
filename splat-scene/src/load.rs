//! From a file or from bytes to a scene: bounded reading, then the reader for the format that the content shows.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::format::{Reader, detect};
use crate::source::Source;
use crate::{Scene, SceneError, ply, sog, splat, spz};

/// The most Gaussians a scene may have.
pub const MAX_GAUSSIANS: usize = 1 << 22;

/// The largest file that is read: twice what 3DGS writes for [`MAX_GAUSSIANS`] of SH degree 3.
pub const MAX_FILE_BYTES: u64 = 2 << 30;

impl Scene {
    /// Reads a scene from a file, whose format is told by its content. Of a SOG scene that is not in a zip, the file is its
    /// `meta.json`; the images are read from the same folder.
    ///
    /// # Errors
    /// [`SceneError`] where the file cannot be read, is no scene, is damaged, or is larger than [`MAX_FILE_BYTES`] or
    /// [`MAX_GAUSSIANS`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = read_bounded(path, MAX_FILE_BYTES)?;
        let name = path.display().to_string();
        let source = Source {
            name: &name,
            bytes: &bytes,
        };
        match detect(&source)? {
            Reader::SogMeta => sog::read_folder(&source, path),
            reader => reader.read(&source),
        }
    }

    /// Reads a scene from a file's content. `name` is what errors call it; where it ends in `.splat`, a format without any
    /// mark of its own, less is asked of the content.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn read(bytes: &[u8], name: &str) -> Result<Self, SceneError> {
        let source = Source { name, bytes };
        detect(&source)?.read(&source)
    }
}

impl Reader {
    fn read(self, source: &Source<'_>) -> Result<Scene, SceneError> {
        match self {
            Self::Ply => ply::read(source),
            Self::Splat => splat::read(source),
            Self::Spz => spz::read(source),
            Self::SogBundle => sog::read_bundle(source),
            Self::SogMeta => Err(SceneError::UnknownFormat {
                name: source.name.to_owned(),
                what: "it is JSON, as the meta.json of a SOG scene is, whose images are not here"
                    .to_owned(),
            }),
        }
    }
}

/// A file's content, unless it is larger than `limit`: also where its size is not known beforehand, as for a pipe.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    let cannot_read = |source| SceneError::Read {
        path: path.to_owned(),
        source,
    };
    let too_large = |bytes| SceneError::TooLarge {
        name: path.display().to_string(),
        bytes,
        limit,
    };
    let file = File::open(path).map_err(cannot_read)?;
    let size = file.metadata().map_err(cannot_read)?.len();
    if size > limit {
        return Err(too_large(size));
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(size).unwrap_or(0).saturating_add(1))
        .map_err(|_| cannot_read(std::io::ErrorKind::OutOfMemory.into()))?;
    file.take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(cannot_read)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}
