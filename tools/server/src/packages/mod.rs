//! The avatar store: packages by their hash, and records of the owners that put them.
//!
//! `packages/HASH` are the bytes, `records/HASH/OWNER` says that this owner put them. An avatar is a person's likeness:
//! an owner can read it only through a record. The record is written before the bytes and removed before
//! them, so bytes without a record are always left over from something that died, and are swept at start; a record
//! without bytes is nothing, until its owner puts the package again.

mod backend;
mod range;
mod upload;

pub(crate) use range::{ByteRange, Conditions};
pub(crate) use upload::UploadError;

use crate::metrics::Metrics;
use crate::{Config, Id, Limits, ServerError, StoreConfig};
use futures_util::{StreamExt, TryStreamExt};
use link_protocol::PackageId;
use object_store::path::Path;
use object_store::{GetOptions, GetResult, ObjectStore, ObjectStoreExt};
use std::collections::HashSet;
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Mutex, Semaphore};

const PACKAGES: &str = "packages";
const RECORDS: &str = "records";

/// The store.
#[derive(Debug)]
pub(crate) struct Packages {
    store: Arc<dyn ObjectStore>,
    spool: PathBuf,
    uploads: Arc<Semaphore>,
    checks: Semaphore,
    limit: u64,
    pause: Duration,
    metrics: Arc<Metrics>,
    /// Locks, one for each 64th of the hashes: held while a package is put or removed, so that these do not interleave.
    stripes: [Mutex<()>; 64],
    /// A local folder is one server's alone as long as this is open.
    _folder: Option<File>,
}

impl Packages {
    pub(crate) async fn open(config: &Config, metrics: Arc<Metrics>) -> Result<Self, ServerError> {
        let Limits {
            spool,
            uploads_at_once,
            checks_at_once,
            package_bytes,
            pause,
            ..
        } = &config.limits;
        let (store, folder) = backend::open(&config.store)?;
        let spool = match (spool, &config.store) {
            (Some(spool), _) => spool.clone(),
            (None, StoreConfig::Local(folder)) => folder.join("spool"),
            (None, StoreConfig::S3 { .. }) => std::env::temp_dir(),
        };
        std::fs::create_dir_all(&spool).map_err(|source| ServerError::Folder {
            path: spool.clone(),
            purpose: "the place for uploads under way",
            source,
        })?;
        Ok(Self {
            store,
            spool,
            uploads: Arc::new(Semaphore::new((*uploads_at_once).max(1))),
            checks: Semaphore::new((*checks_at_once).max(1)),
            limit: *package_bytes,
            pause: *pause,
            metrics,
            stripes: std::array::from_fn(|_| Mutex::default()),
            _folder: folder,
        })
    }

    /// Bytes of the package, if `owner` put it.
    pub(crate) async fn size(
        &self,
        owner: Id,
        hash: PackageId,
    ) -> Result<Option<u64>, object_store::Error> {
        if absent(self.store.head(&record(hash, owner)).await)?.is_none() {
            return Ok(None);
        }
        Ok(absent(self.store.head(&package(hash)).await)?.map(|meta| meta.size))
    }

    /// The bytes `part` of a package that [`Self::size`] found.
    pub(crate) async fn read(
        &self,
        hash: PackageId,
        part: ByteRange,
    ) -> Result<GetResult, object_store::Error> {
        let options = GetOptions {
            range: Some((part.first..part.first + part.count).into()),
            ..GetOptions::default()
        };
        self.store.get_opts(&package(hash), options).await
    }

    /// Removes the owner's record, and the bytes if no other owner's record is left. False if there was no record.
    pub(crate) async fn remove(
        &self,
        owner: Id,
        hash: PackageId,
    ) -> Result<bool, object_store::Error> {
        let _stripe = self.stripe(hash).await;
        let record = record(hash, owner);
        if absent(self.store.head(&record).await)?.is_none() {
            return Ok(false);
        }
        absent(self.store.delete(&record).await)?;
        self.remove_unowned(hash).await?;
        Ok(true)
    }

    /// Whether the store answers.
    pub(crate) async fn probe(&self) -> Result<(), object_store::Error> {
        let nothing = Path::from_iter([RECORDS, "probe"]);
        absent(self.store.head(&nothing).await).map(drop)
    }

    /// Removes packages without an owner, which an earlier process left when it died.
    pub(crate) async fn sweep(&self) -> Result<usize, object_store::Error> {
        let kept: Vec<PackageId> = self
            .names(PACKAGES)
            .try_filter_map(|path| async move { Ok(path.filename().and_then(id)) })
            .try_collect()
            .await?;
        // Listed after the packages, so that one put meanwhile has its record here.
        let owned: HashSet<PackageId> = self
            .names(RECORDS)
            .try_filter_map(|path| async move {
                Ok(path.parts().nth(1).and_then(|part| id(part.as_ref())))
            })
            .try_collect()
            .await?;
        let mut removed = 0;
        for hash in kept.into_iter().filter(|hash| !owned.contains(hash)) {
            let _stripe = self.stripe(hash).await;
            removed += usize::from(self.remove_unowned(hash).await?);
        }
        Ok(removed)
    }

    fn names(
        &self,
        below: &'static str,
    ) -> impl futures_util::Stream<Item = Result<Path, object_store::Error>> {
        self.store
            .list(Some(&Path::from(below)))
            .map_ok(|meta| meta.location)
    }

    /// The hash's stripe is held by the caller.
    async fn remove_unowned(&self, hash: PackageId) -> Result<bool, object_store::Error> {
        let records = Path::from_iter([RECORDS.to_owned(), hash.to_string()]);
        match self.store.list(Some(&records)).next().await {
            Some(Ok(_)) => Ok(false),
            Some(Err(e)) => Err(e),
            None => {
                absent(self.store.delete(&package(hash)).await)?;
                Ok(true)
            }
        }
    }

    async fn stripe(&self, hash: PackageId) -> tokio::sync::MutexGuard<'_, ()> {
        let stripe = usize::from(hash.as_bytes()[0]) % self.stripes.len();
        self.stripes[stripe].lock().await
    }
}

/// The package that this part of a path names.
fn id(name: &str) -> Option<PackageId> {
    name.parse().ok()
}

fn package(hash: PackageId) -> Path {
    Path::from_iter([PACKAGES.to_owned(), hash.to_string()])
}

fn record(hash: PackageId, owner: Id) -> Path {
    Path::from_iter([RECORDS.to_owned(), hash.to_string(), owner.to_string()])
}

/// A missing object is no error.
fn absent<T>(result: Result<T, object_store::Error>) -> Result<Option<T>, object_store::Error> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(object_store::Error::NotFound { .. }) => Ok(None),
        Err(e) => Err(e),
    }
}
