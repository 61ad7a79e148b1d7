//! The avatar store: packages by their hash, and records of the owners that put them.
//!
//! `packages/HASH` are the bytes, `records/HASH/OWNER` says that this owner put them, `owned/OWNER/HASH.BYTES.PUT` the same for who looks by
//! owner; all that the members of an owner's calls put has an owner's name of its own ([`Shelf`]). An avatar is a person's likeness: an owner can read it only through a record. The record is written before the bytes and removed
//! before them, so bytes without a record are always left over from something that died, and are swept at start; a record
//! without bytes is nothing, until its owner puts the package again.

mod locks;
mod owned;
mod places;
mod range;
mod shelf;
mod space;
mod store;
mod upload;

pub(crate) use owned::Owned;
pub(crate) use range::{ByteRange, Conditions};
pub(crate) use shelf::Shelf;
pub(crate) use store::{Content, StoreError};
pub(crate) use upload::UploadError;

use crate::metrics::Metrics;
use crate::{Config, Id, Limits, ServerError, StoreConfig};
use link_protocol::PackageId;
use locks::Locks;
use owned::Quota;
pub(crate) use places::Party;
use places::{Places, Share, Shares};
use space::Space;
use std::collections::HashSet;
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use store::Store;

const PACKAGES: &str = "packages";
const RECORDS: &str = "records";

/// Uploads of one owner, or of one of its calls, that wait to be received.
const WAITING: usize = 32;

/// Uploads of one call that are received at once.
const UPLOADS_PER_CALL: usize = 2;

/// The store.
#[derive(Debug)]
pub(crate) struct Packages {
    store: Store,
    spool: PathBuf,
    uploads: Places,
    checks: Places,
    /// Held while an upload of a member's is received: one of each address in a call at once.
    members: Locks<(Id, IpAddr)>,
    limit: u64,
    quota: Quota,
    space: Space,
    pause: Duration,
    metrics: Arc<Metrics>,
    /// Held while a package of this hash is checked, put or removed, so that these do not interleave.
    hashes: Locks<PackageId>,
    /// Held while an owner's quota is looked at and used. Taken after a hash's, never before.
    owners: Locks<Id>,
}

impl Packages {
    pub(crate) async fn open(config: &Config, metrics: Arc<Metrics>) -> Result<Self, ServerError> {
        let Limits {
            spool,
            uploads_at_once,
            checks_at_once,
            package_bytes,
            packages_per_owner,
            bytes_per_owner,
            store_bytes,
            disk_reserve,
            pause,
            ..
        } = &config.limits;
        let store = Store::open(&config.store)?;
        let spool = match (spool, &config.store) {
            (Some(spool), _) => spool.clone(),
            (None, StoreConfig::Local(folder)) => folder.join("spool"),
            #[cfg(feature = "s3")]
            (None, StoreConfig::S3 { .. }) => std::env::temp_dir(),
        };
        std::fs::create_dir_all(&spool).map_err(|source| ServerError::Folder {
            path: spool.clone(),
            purpose: "the place for uploads under way",
            source,
        })?;
        let folder = match &config.store {
            StoreConfig::Local(folder) => Some((folder.as_path(), store.bytes()?)),
            #[cfg(feature = "s3")]
            StoreConfig::S3 { .. } => None,
        };
        Ok(Self {
            space: Space::new(folder, &spool, *store_bytes, *disk_reserve),
            store,
            spool,
            uploads: Places::new(Shares {
                places: *uploads_at_once,
                of_owner: Share::AsManyAsAreLeft,
                of_call: UPLOADS_PER_CALL,
                waiting: WAITING,
            }),
            // Each that waits has one of the other places.
            checks: Places::new(Shares {
                places: *checks_at_once,
                of_owner: Share::All,
                of_call: *checks_at_once,
                waiting: *uploads_at_once,
            }),
            limit: *package_bytes,
            quota: Quota {
                packages: *packages_per_owner,
                bytes: *bytes_per_owner,
            },
            pause: *pause,
            metrics,
            members: Locks::default(),
            hashes: Locks::default(),
            owners: Locks::default(),
        })
    }

    /// Bytes of the package, if it is on this shelf.
    pub(crate) async fn size(
        &self,
        shelf: Shelf,
        hash: PackageId,
    ) -> Result<Option<u64>, StoreError> {
        self.size_of(shelf.id(), hash).await
    }

    async fn size_of(&self, owner: Id, hash: PackageId) -> Result<Option<u64>, StoreError> {
        if self.store.size(&record(hash, owner)).await?.is_none() {
            return Ok(None);
        }
        self.store.size(&package(hash)).await
    }

    /// The bytes `part` of a package that [`Self::size`] found.
    pub(crate) async fn read(
        &self,
        hash: PackageId,
        part: ByteRange,
    ) -> Result<Content, StoreError> {
        self.store.read(&package(hash), part).await
    }

    /// Removes the shelf's record, and the bytes if no other record is left. False if there was no record.
    pub(crate) async fn remove(&self, shelf: Shelf, hash: PackageId) -> Result<bool, StoreError> {
        let _lock = self.hashes.lock(hash).await;
        let owner = shelf.id();
        if self.store.size(&record(hash, owner)).await?.is_none() {
            return Ok(false);
        }
        self.disown(owner, hash).await?;
        self.remove_unowned(hash).await?;
        Ok(true)
    }

    /// Whether the store answers at all.
    pub(crate) async fn probe(&self) -> Result<(), StoreError> {
        let nothing = format!("{RECORDS}/probe");
        self.store.size(&nothing).await.map(drop)
    }

    /// Removes packages without an owner, which an earlier process left when it died, and mends what is said of owners. How many it removed.
    pub(crate) async fn sweep(&self) -> Result<usize, StoreError> {
        self.sweep_owned().await?;
        let kept = self.hashes(PACKAGES).await?;
        // Listed after the packages, so that one put meanwhile has its record here.
        let owned: HashSet<PackageId> = self.hashes(RECORDS).await?.into_iter().collect();
        let mut removed = 0;
        for hash in kept.into_iter().filter(|hash| !owned.contains(hash)) {
            let _lock = self.hashes.lock(hash).await;
            removed += usize::from(self.remove_unowned(hash).await?);
        }
        Ok(removed)
    }

    /// The hashes that names below `folder` begin with.
    async fn hashes(&self, folder: &str) -> Result<Vec<PackageId>, StoreError> {
        let names = self.store.names(folder).await?;
        let hashes = names.iter().filter_map(|name| name.split('/').nth(1));
        Ok(hashes.filter_map(|hash| hash.parse().ok()).collect())
    }

    /// The hash's lock is held by the caller.
    async fn remove_unowned(&self, hash: PackageId) -> Result<bool, StoreError> {
        let owners = self.store.names(&format!("{RECORDS}/{hash}")).await?;
        if owners.is_empty()
            && let Some(bytes) = self.store.size(&package(hash)).await?
        {
            self.store.delete(&package(hash)).await?;
            self.space.remove(bytes);
        }
        Ok(owners.is_empty())
    }
}

fn package(hash: PackageId) -> String {
    format!("{PACKAGES}/{hash}")
}

fn record(hash: PackageId, owner: Id) -> String {
    format!("{RECORDS}/{hash}/{owner}")
}
