//! How much the store may take of its disk: so many bytes of packages in all, and none of those that have to stay free
//! for whatever else the machine keeps.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The bounds, and what they are compared with.
#[derive(Debug)]
pub(super) struct Space {
    /// The folders of the store, if it is on a disk here, and of uploads under way.
    folders: Vec<PathBuf>,
    /// Bytes that stay free.
    reserve: u64,
    /// Bytes of all packages in the store; nothing for a bucket.
    stored: Option<AtomicU64>,
    most: u64,
}

impl Space {
    /// For a store in `folder`, with packages of `stored` bytes in it, and a spool.
    pub(super) fn new(folder: Option<(&Path, u64)>, spool: &Path, most: u64, reserve: u64) -> Self {
        let folders = folder.iter().map(|(folder, _)| *folder).chain([spool]);
        Self {
            folders: folders.map(Path::to_path_buf).collect(),
            reserve,
            stored: folder.map(|(_, stored)| stored.into()),
            most,
        }
    }

    /// Whether so many bytes more may be stored. A disk that does not tell what is free has room.
    pub(super) fn has_room(&self, bytes: u64) -> bool {
        let stored = self
            .stored
            .as_ref()
            .map_or(0, |stored| stored.load(Relaxed));
        let is_free = |folder: &PathBuf| {
            free(folder)
                .is_none_or(|(free, all)| free.saturating_sub(bytes) >= self.reserve.min(all / 10))
        };
        stored.saturating_add(bytes) <= self.most && self.folders.iter().all(is_free)
    }

    /// A package of so many bytes is stored.
    pub(super) fn add(&self, bytes: u64) {
        if let Some(stored) = &self.stored {
            stored.fetch_add(bytes, Relaxed);
        }
    }

    /// One of so many bytes is removed.
    pub(super) fn remove(&self, bytes: u64) {
        if let Some(stored) = &self.stored {
            let less = |stored: u64| Some(stored.saturating_sub(bytes));
            // It changes it in any case.
            let _ = stored.fetch_update(Relaxed, Relaxed, less);
        }
    }
}

/// Bytes that are free on the disk of this folder, and all that it has.
fn free(folder: &Path) -> Option<(u64, u64)> {
    #[cfg(unix)]
    {
        let disk = rustix::fs::statvfs(folder).ok()?;
        let bytes = |blocks: u64| blocks.saturating_mul(disk.f_frsize);
        Some((bytes(disk.f_bavail), bytes(disk.f_blocks)))
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_take_neither_more_than_they_may_nor_what_has_to_stay_free() {
        let folder = tempfile::tempdir().expect("a folder");
        let here = folder.path();
        let space = Space::new(Some((here, 60)), here, 100, 0);
        assert!(space.has_room(40) && !space.has_room(41));
        space.add(30);
        assert!(space.has_room(10) && !space.has_room(11));
        space.remove(90);
        assert!(space.has_room(100) && !space.has_room(101));
        let bucket = Space::new(None, here, 100, 0);
        bucket.add(1000);
        assert!(bucket.has_room(100), "its provider's");
        let Some((free, all)) = free(here) else {
            return;
        };
        let much = u64::MAX;
        let disk = Space::new(Some((here, 0)), here, much, much);
        assert_eq!(disk.has_room(0), free >= all / 10, "a tenth is kept");
        assert!(!disk.has_room(free), "nothing would be left");
    }
}
