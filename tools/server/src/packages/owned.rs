//! What each owner has put, and how much it may.
//!
//! `owned/OWNER/HASH.BYTES` is written for each record: so one listing, as long as the owner's quota allows, tells what it has. Nothing is
//! counted in memory, so instances that share a store agree.

use super::{Packages, StoreError, record};
use crate::Id;
use link_protocol::PackageId;
use serde::Serialize;
use std::collections::HashSet;

pub(super) const OWNED: &str = "owned";

/// The most that one owner may have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quota {
    pub(super) packages: usize,
    pub(super) bytes: u64,
}

/// An owner has no room for one more package.
#[derive(Debug, thiserror::Error)]
#[error(
    "the owner of this token has {packages} packages here of {} that it may have, with {bytes} of {} bytes, and no room for this one: the owner lists them by GET /v1/packages, and removes one by DELETE /v1/packages/SHA256",
    quota.packages,
    quota.bytes
)]
pub(crate) struct OverQuota {
    packages: usize,
    bytes: u64,
    quota: Quota,
}

/// A package that an owner has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Owned {
    pub(crate) sha256: PackageId,
    pub(crate) bytes: u64,
}

impl Owned {
    /// What it is called in the store.
    pub(super) fn name(self, owner: Id) -> String {
        format!("{OWNED}/{owner}/{}.{}", self.sha256, self.bytes)
    }

    /// Reads such a name, also its owner.
    fn read(name: &str) -> Option<(Id, Self)> {
        let mut parts = name.strip_prefix(OWNED)?.strip_prefix('/')?.split('/');
        let (owner, package) = (parts.next()?, parts.next()?);
        let (sha256, bytes) = package.split_once('.')?;
        let owned = Self {
            sha256: sha256.parse().ok()?,
            bytes: bytes.parse().ok()?,
        };
        Some((Id::parse(owner)?, owned))
    }
}

impl Packages {
    /// What the owner has.
    pub(crate) async fn owned(&self, owner: Id) -> Result<Vec<Owned>, StoreError> {
        let names = self.store.names(&format!("{OWNED}/{owner}")).await?;
        let owned = names.iter().filter_map(|name| Owned::read(name));
        Ok(owned.map(|(_, owned)| owned).collect())
    }

    /// What this owner has, if it has no room for this package.
    pub(super) async fn over_quota(
        &self,
        owner: Id,
        new: Owned,
    ) -> Result<Option<OverQuota>, StoreError> {
        let mut has = self.owned(owner).await?;
        has.retain(|owned| owned.sha256 != new.sha256);
        let (packages, quota) = (has.len(), self.quota);
        let bytes = (has.iter()).fold(0u64, |sum, owned| sum.saturating_add(owned.bytes));
        let is_over = packages >= quota.packages || bytes.saturating_add(new.bytes) > quota.bytes;
        Ok(is_over.then_some(OverQuota {
            packages,
            bytes,
            quota,
        }))
    }

    /// Removes all that says how large the package is that this owner had.
    pub(super) async fn disown(&self, owner: Id, hash: PackageId) -> Result<(), StoreError> {
        for owned in self.owned(owner).await? {
            if owned.sha256 == hash {
                self.store.delete(&owned.name(owner)).await?;
            }
        }
        Ok(())
    }

    /// Makes what is said of owners fit their records, after an earlier process died between the two.
    pub(super) async fn sweep_owned(&self) -> Result<(), StoreError> {
        // Listed before the records, which are written first and removed last.
        let said = self.store.names(OWNED).await?;
        let said: HashSet<(Id, PackageId)> = said
            .iter()
            .filter_map(|name| Owned::read(name))
            .map(|(owner, owned)| (owner, owned.sha256))
            .collect();
        let mut recorded = HashSet::new();
        for name in self.store.names(super::RECORDS).await? {
            let mut parts = name.split('/').skip(1);
            let hash = parts.next().and_then(|hash| hash.parse().ok());
            let owner = parts.next().and_then(Id::parse);
            recorded.extend(owner.zip(hash));
        }
        for &(owner, hash) in said.symmetric_difference(&recorded) {
            let _lock = self.hashes.lock(hash).await;
            match self.size(owner, hash).await? {
                Some(bytes) => {
                    let owned = Owned {
                        sha256: hash,
                        bytes,
                    };
                    self.store.put_name(&owned.name(owner)).await?;
                }
                // A record without bytes counts as nothing.
                None if self.store.size(&record(hash, owner)).await?.is_none() => {
                    self.disown(owner, hash).await?;
                }
                None => {}
            }
        }
        Ok(())
    }
}
