//! The errors of building an avatar.

use std::path::{Path, PathBuf};

/// Why an avatar could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReconstructError {
    /// A file cannot be read.
    #[error("cannot read {}: check that the set-up fetched the MakeHuman data there", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file is not the JSON it should be.
    #[error("{} is not a usable model or list: fetch it again", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What the parser found.
        source: serde_json::Error,
    },
    /// A texture cannot be decoded.
    #[error("cannot decode the texture {}: fetch it again", path.display())]
    Texture {
        /// The file.
        path: PathBuf,
        /// What the decoder found.
        source: image::ImageError,
    },
    /// A file can be read but contradicts itself, or lacks what the person is built from.
    #[error("{} does not fit together: {what}; fetch it again or use the release the recipe names", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The contradiction.
        what: String,
    },
    /// The parts that were decoded do not make a person.
    #[error("the assembled person contradicts itself")]
    Person(#[from] spmm3::PersonError),
}

impl ReconstructError {
    /// A contradiction in `path`.
    pub(crate) fn content(path: &Path, what: impl Into<String>) -> Self {
        Self::Content {
            path: path.to_path_buf(),
            what: what.into(),
        }
    }
}
