//! A folder of one server alone.

use super::super::{ByteRange, PACKAGES};
use super::{Content, StoreError};
use crate::ServerError;
use futures_util::{StreamExt, TryStreamExt};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Result, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use tokio::io::AsyncReadExt;
use tokio_util::io::ReaderStream;

/// Bytes that are read from a file at once.
const CHUNK: usize = 64 << 10;

/// What is being written has this in its name.
const STAGED: char = '#';

#[derive(Debug)]
pub(in crate::packages) struct Folder {
    root: PathBuf,
    /// The folder is this server's alone as long as this is open.
    _lock: File,
}

impl Folder {
    pub(super) fn open(root: &Path) -> std::result::Result<Self, ServerError> {
        let unusable = |source| ServerError::Folder {
            path: root.to_path_buf(),
            purpose: "the package store",
            source,
        };
        std::fs::create_dir_all(root.join(PACKAGES)).map_err(unusable)?;
        let lock = File::create(root.join("lock")).map_err(unusable)?;
        #[expect(
            clippy::disallowed_methods,
            reason = "what it does nothing on is Android, where no server runs"
        )]
        let locked = lock.try_lock();
        locked.map_err(|e| match e {
            TryLockError::WouldBlock => ServerError::FolderTaken {
                path: root.to_path_buf(),
            },
            TryLockError::Error(source) => unusable(source),
        })?;
        sweep_staged(&root.join(PACKAGES)).map_err(unusable)?;
        Ok(Self {
            root: root.to_path_buf(),
            _lock: lock,
        })
    }

    /// Bytes of all packages.
    pub(super) fn bytes(&self) -> std::result::Result<u64, ServerError> {
        let sum = || {
            let entries = std::fs::read_dir(self.root.join(PACKAGES))?;
            let sizes = entries.map(|entry| Ok(entry?.metadata()?.len()));
            sizes.sum::<Result<u64>>()
        };
        sum().map_err(|source| ServerError::Folder {
            path: self.root.clone(),
            purpose: "the package store",
            source,
        })
    }

    pub(super) async fn size(&self, name: &str) -> std::result::Result<Option<u64>, StoreError> {
        let found = absent(tokio::fs::metadata(self.root.join(name)).await);
        Ok(found.map_err(StoreError::File)?.map(|found| found.len()))
    }

    pub(super) async fn read(
        &self,
        name: &str,
        part: ByteRange,
    ) -> std::result::Result<Content, StoreError> {
        let path = self.root.join(name);
        let open = move || {
            let mut file = File::open(path)?;
            file.seek(SeekFrom::Start(part.first))?;
            Ok(file)
        };
        let file = tokio::fs::File::from_std(blocking(open).await?);
        let chunks = ReaderStream::with_capacity(file.take(part.count), CHUNK);
        Ok(chunks.map_err(StoreError::File).boxed())
    }

    /// Goes on to its end where nothing waits for it any more.
    pub(super) async fn put(
        &self,
        name: &str,
        from: Option<File>,
    ) -> std::result::Result<(), StoreError> {
        let path = self.root.join(name);
        blocking(move || write(&path, from)).await
    }

    pub(super) async fn delete(&self, name: &str) -> std::result::Result<(), StoreError> {
        let removed = absent(tokio::fs::remove_file(self.root.join(name)).await);
        removed.map(drop).map_err(StoreError::File)
    }

    pub(super) async fn names(&self, below: &str) -> std::result::Result<Vec<String>, StoreError> {
        let (root, below) = (self.root.clone(), below.to_owned());
        blocking(move || {
            let mut found = Vec::new();
            let mut folders = vec![below];
            while let Some(folder) = folders.pop() {
                let Some(entries) = absent(std::fs::read_dir(root.join(&folder)))? else {
                    continue;
                };
                for entry in entries {
                    let entry = entry?;
                    let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
                    if entry.file_type()?.is_dir() {
                        folders.push(name);
                    } else if !name.contains(STAGED) {
                        found.push(name);
                    }
                }
            }
            Ok(found)
        })
        .await
    }
}

/// Writes beside `path`, and renames when all of it is on the disk.
fn write(path: &Path, from: Option<File>) -> Result<()> {
    let folder = path.parent().ok_or(ErrorKind::InvalidInput)?;
    let is_new = !folder.is_dir();
    std::fs::create_dir_all(folder)?;
    let mut staged = tempfile::Builder::new()
        .prefix(&STAGED.to_string())
        .tempfile_in(folder)?;
    if let Some(mut from) = from {
        from.rewind()?;
        std::io::copy(&mut from, staged.as_file_mut())?;
    }
    staged.as_file().sync_all()?;
    staged.persist(path)?;
    // Its name too, and its folder's.
    #[cfg(unix)]
    {
        File::open(folder)?.sync_all()?;
        if let (true, Some(above)) = (is_new, folder.parent()) {
            File::open(above)?.sync_all()?;
        }
    }
    Ok(())
}

/// Removes what an earlier process was writing when it died.
fn sweep_staged(packages: &Path) -> Result<()> {
    for entry in std::fs::read_dir(packages)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().contains(STAGED) {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// What is not there is no error.
fn absent<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}

/// Does what waits for a disk on a thread that may wait.
async fn blocking<T: Send + 'static>(
    task: impl FnOnce() -> Result<T> + Send + 'static,
) -> std::result::Result<T, StoreError> {
    let done = tokio::task::spawn_blocking(task).await;
    done.unwrap_or_else(|e| Err(std::io::Error::other(e)))
        .map_err(StoreError::File)
}
