//! What each owner has put, and how much it may.
//!
//! `owned/OWNER/HASH.BYTES.PUT` is written for each record, with the time in Unix seconds: so one listing, as long as the owner's quota allows, tells what it
//! has, and what is oldest. A name without a time, of an earlier version, counts as older than all others. Nothing is counted in memory, so instances that
//! share a store agree.

use super::{Packages, Shelf, StoreError, record};
use crate::Id;
use link_protocol::PackageId;
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::HashSet;

pub(super) const OWNED: &str = "owned";

/// The most that one owner may have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quota {
    pub(super) packages: usize,
    pub(super) bytes: u64,
}

impl Quota {
    /// Whether who has these may have this one, too.
    fn has_room(self, has: &[Owned], new: Owned) -> bool {
        has.len() < self.packages && bytes_of(has).saturating_add(new.bytes) <= self.bytes
    }
}

fn bytes_of(has: &[Owned]) -> u64 {
    (has.iter()).fold(0, |sum, owned| sum.saturating_add(owned.bytes))
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
    /// When, Unix seconds; 0 where nobody knows any more.
    #[serde(skip)]
    pub(super) put: u64,
}

impl Owned {
    /// What it is called in the store.
    pub(super) fn name(self, owner: Id) -> String {
        let Self { sha256, bytes, put } = self;
        format!("{OWNED}/{owner}/{sha256}.{bytes}.{put}")
    }

    /// Reads such a name, also its owner.
    fn read(name: &str) -> Option<(Id, Self)> {
        let mut parts = name.strip_prefix(OWNED)?.strip_prefix('/')?.split('/');
        let (owner, package) = (parts.next()?, parts.next()?);
        let (sha256, rest) = package.split_once('.')?;
        let (bytes, put) = rest.split_once('.').unwrap_or((rest, "0"));
        let owned = Self {
            sha256: sha256.parse().ok()?,
            bytes: bytes.parse().ok()?,
            put: put.parse().ok()?,
        };
        Some((Id::parse(owner)?, owned))
    }
}

impl Packages {
    /// What is on this shelf.
    pub(crate) async fn owned(&self, shelf: Shelf) -> Result<Vec<Owned>, StoreError> {
        let names = self.names_of(shelf.id()).await?;
        let mut owned: Vec<_> = names.into_iter().map(|(_, owned)| owned).collect();
        // One that two instances put at one moment may have two names.
        owned.sort_by_key(|owned| (owned.sha256, owned.put));
        owned.dedup_by_key(|owned| owned.sha256);
        Ok(owned)
    }

    /// What this owner has put, with the names that say so.
    async fn names_of(&self, owner: Id) -> Result<Vec<(String, Owned)>, StoreError> {
        let names = self.store.names(&format!("{OWNED}/{owner}")).await?;
        let owned = names.into_iter().filter_map(|name| {
            let (_, owned) = Owned::read(&name)?;
            Some((name, owned))
        });
        Ok(owned.collect())
    }

    /// What this owner has on its own shelf, if it has no room there for this package.
    pub(super) async fn over_quota(
        &self,
        shelf: Shelf,
        new: Owned,
    ) -> Result<Option<OverQuota>, StoreError> {
        let mut has = match shelf {
            Shelf::Own(_) => self.owned(shelf).await?,
            // All that is there can make room.
            Shelf::Members(_) => Vec::new(),
        };
        has.retain(|owned| owned.sha256 != new.sha256);
        Ok((!self.quota.has_room(&has, new)).then(|| OverQuota {
            packages: has.len(),
            bytes: bytes_of(&has),
            quota: self.quota,
        }))
    }

    /// Takes so many packages off a members' shelf that there is room for this one: the oldest, but those that are `shown` in a room here after all others.
    /// Their bytes are left. The shelf's lock is held by the caller.
    pub(super) async fn make_room(
        &self,
        shelf: Shelf,
        new: Owned,
        shown: &HashSet<PackageId>,
        made_room: &mut Vec<PackageId>,
    ) -> Result<(), StoreError> {
        let Shelf::Members(_) = shelf else {
            return Ok(());
        };
        let mut has = self.owned(shelf).await?;
        has.retain(|owned| owned.sha256 != new.sha256);
        // The last is the first to go.
        has.sort_by_key(|owned| Reverse((shown.contains(&owned.sha256), owned.put)));
        while !self.quota.has_room(&has, new)
            && let Some(oldest) = has.pop()
        {
            self.disown(shelf.id(), oldest.sha256).await?;
            made_room.push(oldest.sha256);
        }
        Ok(())
    }

    /// Says that the package is on this owner's shelf, unless that is said already.
    pub(super) async fn own(&self, owner: Id, new: Owned) -> Result<(), StoreError> {
        let names = self.names_of(owner).await?;
        let same = |owned: &Owned| (owned.sha256, owned.bytes) == (new.sha256, new.bytes);
        if names.iter().any(|(_, owned)| same(owned)) {
            return Ok(());
        }
        self.store.put_name(&new.name(owner)).await
    }

    /// Removes all that says that this owner has the package; the record last, so that what is left of it is found at the next start.
    pub(super) async fn disown(&self, owner: Id, hash: PackageId) -> Result<(), StoreError> {
        for (name, owned) in self.names_of(owner).await? {
            if owned.sha256 == hash {
                self.store.delete(&name).await?;
            }
        }
        self.store.delete(&record(hash, owner)).await
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
            match self.size_of(owner, hash).await? {
                Some(bytes) => {
                    let owned = Owned {
                        sha256: hash,
                        bytes,
                        put: 0,
                    };
                    self.own(owner, owned).await?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_what_an_owner_has_and_when_it_was_put_if_that_is_known() {
        let owner = Id::of_owner("ada");
        let owned = Owned {
            sha256: PackageId::of_bytes(b"package"),
            bytes: 7,
            put: 1_800_000_000,
        };
        let name = owned.name(owner);
        assert_eq!(Owned::read(&name), Some((owner, owned)), "{name}");
        let before = format!("{OWNED}/{owner}/{}.7", owned.sha256);
        let oldest = Owned { put: 0, ..owned };
        assert_eq!(Owned::read(&before), Some((owner, oldest)), "{before}");
        for other in [format!("{name}.1"), format!("{before}."), owner.to_string()] {
            assert_eq!(Owned::read(&other), None, "{other}");
        }
    }
}
