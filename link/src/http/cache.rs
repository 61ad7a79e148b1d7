//! The folder that keeps packages: whole ones by their hash, parts of ones that are on their way.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::{HttpError, PackageId};

/// Bytes of whole packages kept; beyond, those not used for longest go.
const KEPT: u64 = 4 << 30;
const WHOLE: &str = "m3a";

/// A folder of packages, which several programs may use at once.
#[derive(Debug, Clone)]
pub struct PackageCache {
    folder: PathBuf,
}

impl PackageCache {
    /// The cache in `folder`, which is made if missing.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if it cannot be made.
    pub fn new(folder: impl Into<PathBuf>) -> Result<Self, HttpError> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(|source| cannot("make the folder", &folder, source))?;
        Ok(Self { folder })
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where a whole package lies.
    pub(super) fn whole(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.{WHOLE}"))
    }

    /// Where it lies while it is on its way.
    pub(super) fn part(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.part"))
    }

    /// Keeps others from downloading the same package until the file is dropped; waits for who does so already. Blocks.
    pub(super) fn lock(&self, package: &PackageId) -> Result<File, HttpError> {
        let path = self.folder.join(format!("{package}.lock"));
        let lock = || -> io::Result<File> {
            let file = File::options()
                .create(true)
                .write(true)
                .truncate(false)
                .open(&path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    log::info!("another program is fetching this package: waiting for it");
                    file.lock()?;
                }
                Err(TryLockError::Error(error)) => return Err(error),
                Ok(()) => {}
            }
            Ok(file)
        };
        lock().map_err(|source| cannot("lock", &path, source))
    }

    /// The whole package if it is here, intact, and of this size. A damaged one is removed. Blocks: reads all of it.
    pub(super) fn find(
        &self,
        package: &PackageId,
        bytes: u64,
    ) -> Result<Option<PathBuf>, HttpError> {
        let path = self.whole(package);
        let Ok(metadata) = path.metadata() else {
            return Ok(None);
        };
        if metadata.len() == bytes && PackageId::of_file(&path)? == *package {
            // For `evict`; where times cannot be set, it goes by downloads instead.
            if let Err(error) = File::options()
                .write(true)
                .open(&path)
                .and_then(|file| file.set_modified(SystemTime::now()))
            {
                log::debug!("{}: {error}", path.display());
            }
            return Ok(Some(path));
        }
        log::warn!("{} is damaged and is fetched again", path.display());
        fs::remove_file(&path).map_err(|source| cannot("remove", &path, source))?;
        Ok(None)
    }

    /// Removes the packages not used for longest until the rest is within bounds; never `but`.
    pub(super) fn evict(&self, but: &Path) {
        let Ok(entries) = fs::read_dir(&self.folder) else {
            return;
        };
        let mut packages: Vec<_> = entries
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let metadata = path.metadata().ok()?;
                let is_package =
                    path.extension().is_some_and(|extension| extension == WHOLE) && path != but;
                is_package.then(|| Some((metadata.modified().ok()?, metadata.len(), path)))?
            })
            .collect();
        packages.sort();
        let mut all: u64 = packages.iter().map(|(_, bytes, _)| bytes).sum();
        for (_, bytes, path) in packages {
            if all <= KEPT {
                return;
            }
            if let Err(error) = fs::remove_file(&path) {
                log::debug!("{}: {error}", path.display());
            }
            all -= bytes;
        }
    }
}

/// What the system refused, with a disk that is full told apart elsewhere.
pub(super) fn cannot(doing: &'static str, path: &Path, source: io::Error) -> HttpError {
    HttpError::Cache {
        doing,
        path: path.to_owned(),
        source,
    }
}
