//! The folder the package was unpacked to, and typed reading from it.

use crate::ReconstructError;
use image::RgbaImage;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// The unpacked package.
#[derive(Debug, Clone)]
pub struct Package {
    root: PathBuf,
}

impl Package {
    /// Names the folder that holds the package's `public` and `src`.
    #[must_use]
    pub fn new(root: &Path) -> Self {
        Self {
            root: root.to_path_buf(),
        }
    }

    /// Path of a file below `public/data`.
    #[must_use]
    pub fn data(&self, relative: &str) -> PathBuf {
        self.root.join("public/data").join(relative)
    }

    /// Path of a file below the package itself.
    #[must_use]
    pub fn file(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }
}

/// Reads a JSON file.
///
/// # Errors
/// If the file cannot be read or is not a `T`.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, ReconstructError> {
    let bytes = std::fs::read(path).map_err(|source| ReconstructError::Read {
        path: path.to_path_buf(),
        source,
    })?;
    serde_json::from_slice(&bytes).map_err(|source| ReconstructError::Json {
        path: path.to_path_buf(),
        source,
    })
}

/// Reads a PNG or JPEG texture as 8-bit sRGB with alpha.
///
/// # Errors
/// If the file cannot be read or is not an image.
pub fn read_texture(path: &Path) -> Result<RgbaImage, ReconstructError> {
    let bytes = std::fs::read(path).map_err(|source| ReconstructError::Read {
        path: path.to_path_buf(),
        source,
    })?;
    image::load_from_memory(&bytes)
        .map(|image| image.to_rgba8())
        .map_err(|source| ReconstructError::Texture {
            path: path.to_path_buf(),
            source,
        })
}
