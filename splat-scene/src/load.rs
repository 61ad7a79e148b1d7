//! From a file or from bytes to a scene: bounded reading, then the reader for the format that the content shows.

use std::path::Path;

use crate::detect::{Reader, detect};
use crate::limits::MAX_FILE_BYTES;
use crate::source::{Source, read_bounded};
use crate::{Scene, SceneError, ply, sog, splat, spz};

impl Scene {
    /// Reads a scene from a file, whose format is detected by its content. Of a SOG scene that is not in a zip, the file is its
    /// `meta.json`; the images are read from the same folder.
    ///
    /// # Errors
    /// [`SceneError`] where the file cannot be read, is no scene, is damaged, or is larger than [`crate::MAX_FILE_BYTES`] or
    /// [`crate::MAX_GAUSSIANS`].
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
