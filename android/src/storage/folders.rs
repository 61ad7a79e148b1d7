//! The app's two folders: one that no other app can read, one that adb can.

use crate::package::SETTINGS_FILE;
use link_http::{HttpError, PackageCache};
use std::path::{Path, PathBuf};

/// Folders of the app.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folders {
    own: PathBuf,
    shared: PathBuf,
}

impl Folders {
    /// With what Android calls the internal and the external files folder.
    #[must_use]
    pub fn new(own: impl Into<PathBuf>, shared: impl Into<PathBuf>) -> Self {
        Self {
            own: own.into(),
            shared: shared.into(),
        }
    }

    /// `mon3tr.toml`, where adb can push it.
    #[must_use]
    pub fn settings_file(&self) -> PathBuf {
        self.shared.join(SETTINGS_FILE)
    }

    /// Where a profile is written, so that adb can pull it.
    #[must_use]
    pub fn profile(&self) -> PathBuf {
        self.shared.join("profile")
    }

    /// The avatar that a profile shows, where adb can push it.
    #[must_use]
    pub fn demo_avatar(&self) -> PathBuf {
        self.shared.join("avatar.m3a")
    }

    /// The wearer's own avatar of that name, where adb can push it.
    #[must_use]
    pub fn avatar(&self, name: &str) -> PathBuf {
        self.shared.join(name)
    }

    /// Networks compiled for the NPU.
    #[must_use]
    pub fn compiled(&self) -> PathBuf {
        self.own.join("compiled")
    }

    /// The folder whose contents no other app can read.
    #[must_use]
    pub fn own(&self) -> &Path {
        &self.own
    }

    /// The packages, at most so many bytes of them. The least recently used packages over that limit are removed now,
    /// and so are interrupted downloads that were not resumed.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if the folder cannot be made.
    pub fn packages(&self, most_bytes: u64) -> Result<PackageCache, HttpError> {
        let cache = PackageCache::new(self.own.join("packages"))?.with_limit(most_bytes);
        cache.tidy();
        Ok(cache)
    }
}
