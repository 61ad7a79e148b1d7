//! The folder that keeps packages between calls: `SHA256.m3a` is whole, `SHA256.part` is on its way, `SHA256.lock` is held by whoever
//! fetches it. Any number of processes may share a folder. A whole file's name is a promise that is checked before each use, so
//! nothing needs to be flushed to the disk before its rename. A lock that somebody shares keeps a whole package from being removed.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use crate::{HttpError, file_lock::FileLock};
use link_protocol::{PackageId, announcement::AvatarRef};

/// Bytes that a cache keeps unless told otherwise.
const KEPT: u64 = 4_000_000_000;

/// A part that nobody went on with for so long is not worth its place.
const ABANDONED: Duration = Duration::from_secs(7 * 24 * 3600);

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
pub(crate) struct Lock(#[expect(dead_code, reason = "held, never read")] Arc<FileLock>);

/// Keeps a package from being removed, by this and by other processes, until it is dropped.
#[derive(Debug)]
pub struct PackageInUse(#[expect(dead_code, reason = "held, never read")] FileLock);

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

    /// Says that a package is in use: it stays, however long ago it was fetched, until what this gives is dropped. Nothing if
    /// somebody is about to write the package at this moment.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if its lock cannot be had.
    pub fn in_use(&self, package: &PackageId) -> Result<Option<PackageInUse>, HttpError> {
        let (path, file) = self.lock_file(package)?;
        let lock = FileLock::shared(file).map_err(|why| self.wrong("lock", &path, 0, why))?;
        Ok(lock.map(PackageInUse))
    }

    /// Brings the folder within its bound now (which may have been larger before), and removes what interrupted downloads left a
    /// week ago. What is in use or being fetched stays.
    pub fn tidy(&self) {
        let now = SystemTime::now();
        for kept in self.kept() {
            let age = now.duration_since(kept.used).unwrap_or_default();
            if kept.is_part && age > ABANDONED {
                self.remove(&kept, "nobody went on fetching it");
            }
        }
        self.shrink(None);
    }

    pub(crate) fn whole(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.m3a"))
    }

    pub(crate) fn part(&self, package: &PackageId) -> PathBuf {
        self.folder.join(format!("{package}.part"))
    }

    /// The whole package, if it is there and what its name says. Reads all of it: not for an async task.
    pub(crate) fn look_up(&self, avatar: &AvatarRef) -> Option<PathBuf> {
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
    pub(crate) async fn lock(&self, package: &PackageId) -> Result<Lock, HttpError> {
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

    fn try_lock(&self, package: &PackageId) -> Result<Option<Lock>, HttpError> {
        let (path, file) = self.lock_file(package)?;
        let lock = FileLock::exclusive(file).map_err(|why| self.wrong("lock", &path, 0, why))?;
        Ok(lock.map(|lock| Lock(Arc::new(lock))))
    }

    /// Lock files are never removed: somebody may be about to lock the one that is gone while the next one locks a new one.
    fn lock_file(&self, package: &PackageId) -> Result<(PathBuf, File), HttpError> {
        let path = self.folder.join(format!("{package}.lock"));
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|source| self.wrong("lock", &path, 0, source))?;
        Ok((path, file))
    }

    /// What the system says of a file here. `needed`: bytes still to be written.
    pub(crate) fn wrong(
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

    /// Removes what was not used for longest until the rest is within the bound. Spares `newest`, what is in use, and parts that
    /// are being fetched.
    pub(crate) fn evict(&self, newest: &PackageId) {
        self.shrink(Some(newest));
    }

    fn shrink(&self, newest: Option<&PackageId>) {
        let kept = self.kept();
        let mut total: u64 = kept.iter().map(|one| one.bytes).sum();
        for one in kept {
            if total <= self.limit {
                return;
            }
            if newest != Some(&one.package) && self.remove(&one, "to keep within its bound") {
                total -= one.bytes;
            }
        }
    }

    /// The files that are the cache's, those first that were not used for longest.
    fn kept(&self) -> Vec<Kept> {
        let Ok(folder) = fs::read_dir(&self.folder) else {
            return Vec::new();
        };
        let mut kept: Vec<Kept> = folder
            .filter_map(|entry| Kept::of(entry.ok()?.path()))
            .collect();
        kept.sort();
        kept
    }

    /// Removes a file unless somebody uses or fetches its package; says whether it is gone.
    fn remove(&self, kept: &Kept, why: &str) -> bool {
        let Ok(Some(_lock)) = self.try_lock(&kept.package) else {
            return false;
        };
        let path = kept.path.display();
        match fs::remove_file(&kept.path) {
            Ok(()) => {
                log::info!("removed {path} from the package cache: {why}");
                true
            }
            Err(error) => {
                log::warn!("cannot remove {path} from the package cache: {error}");
                false
            }
        }
    }
}

/// A file of the cache. Ordered by when it was used.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Kept {
    used: SystemTime,
    bytes: u64,
    path: PathBuf,
    package: PackageId,
    is_part: bool,
}

impl Kept {
    /// Nothing for a file that is not the cache's.
    fn of(path: PathBuf) -> Option<Self> {
        let extension = path.extension()?;
        let is_part = extension == "part";
        if !is_part && extension != "m3a" {
            return None;
        }
        let package = path.file_stem()?.to_str()?.parse().ok()?;
        // Not through links: what they lead to is not in the folder.
        let metadata = path.symlink_metadata().ok()?;
        Some(Self {
            used: metadata.modified().ok()?,
            bytes: metadata.len(),
            path,
            package,
            is_part,
        })
    }
}
