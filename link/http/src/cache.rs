//! The folder that keeps packages between calls: `SHA256.m3a` is complete, `SHA256.part` is being downloaded, `SHA256.lock` is locked
//! by the program that downloads it. Any number of processes may share a folder. A complete file's hash is checked before each use, so
//! it need not be flushed to the disk before its rename. A shared lock keeps a package from being removed.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use crate::{HttpError, file_lock::FileLock};
use link_protocol::{PackageId, announcement::AvatarRef};

/// Bytes that a cache keeps by default.
const DEFAULT_LIMIT: u64 = 4_000_000_000;

/// An interrupted download that was not resumed for so long is removed.
const ABANDONED: Duration = Duration::from_secs(7 * 24 * 3600);

/// How often a lock that another process holds is tried.
const LOCK_POLL: Duration = Duration::from_millis(100);

/// A folder of packages. When it grows over its limit, 4 GB by default, the least recently used packages are removed.
#[derive(Debug, Clone)]
pub struct PackageCache {
    folder: PathBuf,
    limit: u64,
}

/// The right to write one package's files, held until the last copy is dropped.
#[derive(Debug, Clone)]
pub(crate) struct Lock(#[expect(dead_code, reason = "held, never read")] Arc<FileLock>);

/// Keeps a package from being removed, by this and by other processes, until it is dropped.
#[derive(Debug)]
pub struct PackageInUse(#[expect(dead_code, reason = "held, never read")] FileLock);

impl PackageCache {
    /// The cache in this folder, which is created, readable by this user only, if it does not exist.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if it cannot be created.
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
            limit: DEFAULT_LIMIT,
        })
    }

    /// The same with another limit, in bytes. The package downloaded last stays, however large.
    #[must_use]
    pub fn with_limit(self, bytes: u64) -> Self {
        Self {
            limit: bytes,
            ..self
        }
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Marks a package as in use: it is not removed until the returned guard is dropped. Nothing if a program is writing the package
    /// at this moment.
    ///
    /// # Errors
    /// [`HttpError::Cache`] if its lock cannot be had.
    pub fn in_use(&self, package: &PackageId) -> Result<Option<PackageInUse>, HttpError> {
        let (path, file) = self.lock_file(package)?;
        let lock = FileLock::shared(file).map_err(|why| self.io_error("lock", &path, 0, why))?;
        Ok(lock.map(PackageInUse))
    }

    /// Brings the folder within its limit now, and removes what interrupted downloads left a week ago. Packages that are in use or being
    /// downloaded stay.
    pub fn tidy(&self) {
        let now = SystemTime::now();
        for file in self.files() {
            let age = now.duration_since(file.used).unwrap_or_default();
            if file.is_part && age > ABANDONED {
                self.remove(&file, "its download was not resumed");
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

    /// The complete package, if it is there and has its hash. Reads all of it: not for an async task.
    pub(crate) fn look_up(&self, avatar: &AvatarRef) -> Option<PathBuf> {
        let path = self.whole(&avatar.sha256);
        if path.metadata().ok()?.len() != avatar.bytes || AvatarRef::of_file(&path).ok()? != *avatar
        {
            log::warn!("{} is damaged and will be downloaded again", path.display());
            return None;
        }
        // The time of use, for `evict`. A cache that cannot be written to can still be read.
        if let Ok(file) = File::options().append(true).open(&path) {
            let _ = file.set_modified(SystemTime::now());
        }
        Some(path)
    }

    /// Waits until no other download, of this or another process, writes this package.
    pub(crate) async fn lock(&self, package: &PackageId) -> Result<Lock, HttpError> {
        let mut logged = false;
        loop {
            if let Some(lock) = self.try_lock(package)? {
                return Ok(lock);
            }
            if !std::mem::replace(&mut logged, true) {
                log::info!("another program is downloading package {package}: waiting for it");
            }
            tokio::time::sleep(LOCK_POLL).await;
        }
    }

    fn try_lock(&self, package: &PackageId) -> Result<Option<Lock>, HttpError> {
        let (path, file) = self.lock_file(package)?;
        let lock = FileLock::exclusive(file).map_err(|why| self.io_error("lock", &path, 0, why))?;
        Ok(lock.map(|lock| Lock(Arc::new(lock))))
    }

    /// Lock files are never removed: one program could lock the removed file while another one locks its successor.
    fn lock_file(&self, package: &PackageId) -> Result<(PathBuf, File), HttpError> {
        let path = self.folder.join(format!("{package}.lock"));
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|source| self.io_error("lock", &path, 0, source))?;
        Ok((path, file))
    }

    /// The system's error as one of this cache. `needed`: bytes still to be written.
    pub(crate) fn io_error(
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

    /// Removes the least recently used files until the rest is within the limit, but not `newest`, packages in use, and downloads under
    /// way.
    pub(crate) fn evict(&self, newest: &PackageId) {
        self.shrink(Some(newest));
    }

    fn shrink(&self, newest: Option<&PackageId>) {
        let files = self.files();
        let mut total: u64 = files.iter().map(|file| file.bytes).sum();
        for file in files {
            if total <= self.limit {
                return;
            }
            if newest != Some(&file.package) && self.remove(&file, "to keep within its limit") {
                total -= file.bytes;
            }
        }
    }

    /// The cache's files, the least recently used first.
    fn files(&self) -> Vec<CachedFile> {
        let Ok(folder) = fs::read_dir(&self.folder) else {
            return Vec::new();
        };
        let mut files: Vec<CachedFile> = folder
            .filter_map(|entry| CachedFile::of(entry.ok()?.path()))
            .collect();
        files.sort();
        files
    }

    /// Removes a file unless its package is in use or being downloaded; returns whether it did.
    fn remove(&self, file: &CachedFile, why: &str) -> bool {
        let Ok(Some(_lock)) = self.try_lock(&file.package) else {
            return false;
        };
        let path = file.path.display();
        match fs::remove_file(&file.path) {
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

/// A file of the cache, ordered by its last use.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct CachedFile {
    used: SystemTime,
    bytes: u64,
    path: PathBuf,
    package: PackageId,
    is_part: bool,
}

impl CachedFile {
    /// Nothing for a file that is not one of the cache's.
    fn of(path: PathBuf) -> Option<Self> {
        let extension = path.extension()?;
        let is_part = extension == "part";
        if !is_part && extension != "m3a" {
            return None;
        }
        let package = path.file_stem()?.to_str()?.parse().ok()?;
        // Without following links, which lead out of the folder.
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
