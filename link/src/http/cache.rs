//! The folder that keeps packages between calls: `SHA256.m3a` is whole, `SHA256.part` is on its way, `SHA256.lock` is held by whoever
//! fetches it. Any number of processes may share a folder. A whole file's name is a promise that is checked before each use, so
//! nothing needs to be flushed to the disk before its rename.

use std::{
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use super::{AvatarRef, HttpError, PackageId};

/// Bytes that a cache keeps unless told otherwise.
const KEPT: u64 = 4_000_000_000;

/// How often a lock that another process holds is tried.
const LOCK_EVERY: Duration = Duration::from_millis(100);

/// A folder of packages. When it grows over its bound, 4 GB unless told otherwise, those go that were not used for longest.
#[derive(Debug, Clone)]
pub struct PackageCache {
    folder: PathBuf,
    limit: u64,
}

/// The right to write one package's files. The file's lock goes with the last copy, at the latest with the process.
#[derive(Debug, Clone)]
pub(super) struct Lock(#[expect(dead_code, reason = "held, never read")] Arc<File>);

impl PackageCache {
    /// The cache in this folder, which is made, for this user's eyes only, if it is not there.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if it cannot be made.
    pub fn new(folder: impl Into<PathBuf>) -> Result<Self, HttpError> {
        let folder = folder.into();
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(&folder).map_err(|source| HttpError::Cache {
            doing: "make package cache",
            path: folder.clone(),
            source,
        })?;
        Ok(Self {
            folder,
            limit: KEPT,
        })
    }

    /// The same with another bound, in bytes. The package fetched last stays, however large.
    #[must_use]
    pub fn with_limit(self, bytes: u64) -> Self {
        Self {
            limit: bytes,
            ..self
        }
    }

    /// Where it is.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub(super) fn whole(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.m3a"))
    }

    pub(super) fn part(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.part"))
    }

    /// The whole package, if it is there and what its name says. Reads all of it: not for an async task.
    pub(super) fn look_up(&self, avatar: &AvatarRef) -> Option<PathBuf> {
        let path = self.whole(&avatar.sha256);
        if path.metadata().ok()?.len() != avatar.bytes
            || PackageId::of_file(&path).ok()? != avatar.sha256
        {
            log::warn!("{} is damaged and will be fetched anew", path.display());
            return None;
        }
        // For `evict`. A cache that cannot be written to is still good for reading.
        if let Ok(file) = File::options().append(true).open(&path) {
            let _ = file.set_modified(SystemTime::now());
        }
        Some(path)
    }

    /// Waits until no other process, and nothing else in this one, writes this package.
    pub(super) async fn lock(&self, package: &PackageId) -> Result<Lock, HttpError> {
        let mut told = false;
        loop {
            if let Some(lock) = self.try_lock(package)? {
                return Ok(lock);
            }
            if !std::mem::replace(&mut told, true) {
                log::info!("another program is fetching package {package}: waiting for it");
            }
            tokio::time::sleep(LOCK_EVERY).await;
        }
    }

    /// Lock files are never removed: somebody may be about to lock the one that is gone while the next one locks a new one.
    fn try_lock(&self, package: &PackageId) -> Result<Option<Lock>, HttpError> {
        let path = self.folder.join(format!("{package}.lock"));
        let wrong = |source| self.wrong("lock", &path, 0, source);
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(wrong)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Lock(Arc::new(file)))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(source)) => Err(wrong(source)),
        }
    }

    /// What the system says of a file here. `needed`: bytes still to be written.
    pub(super) fn wrong(
        &self,
        doing: &'static str,
        path: &Path,
        needed: u64,
        source: io::Error,
    ) -> HttpError {
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => HttpError::DiskFull {
                folder: self.folder.clone(),
                needed,
            },
            _ => HttpError::Cache {
                doing,
                path: path.to_owned(),
                source,
            },
        }
    }

    /// Removes what was not used for longest until the rest is within the bound. Spares `newest`, and parts that are being fetched.
    pub(super) fn evict(&self, newest: &PackageId) {
        let Ok(folder) = fs::read_dir(&self.folder) else {
            return;
        };
        let mut files: Vec<(SystemTime, u64, PathBuf, PackageId)> = folder
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let ours = path
                    .extension()
                    .is_some_and(|extension| extension == "m3a" || extension == "part");
                let package = path.file_stem()?.to_str()?.parse().ok()?;
                let metadata = path.metadata().ok()?;
                ours.then_some((metadata.modified().ok()?, metadata.len(), path, package))
            })
            .collect();
        files.sort();
        let mut total: u64 = files.iter().map(|(_, bytes, ..)| bytes).sum();
        for (_, bytes, path, package) in files {
            if total <= self.limit {
                return;
            }
            if package == *newest {
                continue;
            }
            let Ok(Some(_lock)) = self.try_lock(&package) else {
                continue;
            };
            match fs::remove_file(&path) {
                Ok(()) => {
                    total -= bytes;
                    log::info!(
                        "removed {} from the package cache to keep it within its bound",
                        path.display()
                    );
                }
                Err(error) => log::warn!(
                    "cannot remove {} from the package cache: {error}",
                    path.display()
                ),
            }
        }
    }
}
