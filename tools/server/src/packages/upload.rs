//! Uploads: received into a file without a name, checked there, then copied into the store in one step.
//!
//! The spool file has no name (`O_TMPFILE`), so nothing of it is left when the process dies.

use super::locks::Held;
use super::owned::OverQuota;
use super::places::Place;
use super::{Owned, Packages, Party, Shelf, StoreError, package, record};
use crate::metrics::UploadRefusal;
use crate::token::now;
use bytes::Bytes;
use futures_util::{Stream, StreamExt};
use link_protocol::PackageId;
use link_protocol::package_id::PackageHasher;
use spmm3::{Avatar, PackageError};
use std::collections::HashSet;
use std::io::{BufReader, ErrorKind, Seek};
use std::net::IpAddr;
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio::time::{Instant, timeout};
use turn_server::network_prefix;

/// How long an upload may wait to be received: well below what its client takes for a broken connection.
const RECEIVED_WITHIN: Duration = Duration::from_secs(8);

/// Bytes a second that an upload has to bring on average after its first seconds: an upload of 14 MB that is slower is
/// not received within the default `upload_within` in any case.
const SLOWEST: u32 = 8 << 10;
const SLOW_AT_FIRST: Duration = Duration::from_secs(10);

/// Bytes after which it is looked at again whether the disk has room.
const LOOK_AGAIN: u64 = 1 << 20;

/// Why an upload is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum UploadError {
    #[error("a package may have {limit} bytes at most")]
    TooLarge { limit: u64 },
    #[error("the upload ended before its end; nothing of it was kept")]
    Truncated,
    #[error("the upload paused for too long; nothing of it was kept")]
    Paused,
    #[error("the upload brought less than {SLOWEST} bytes a second; nothing of it was kept")]
    Slow,
    #[error("the bytes have the SHA-256 {found}, not the one in the request's path")]
    Hash { found: PackageId },
    #[error("{}", chain(.0))]
    Package(PackageError),
    #[error(
        "the server's disk is full, but for what has to stay free; nothing of the upload was kept"
    )]
    DiskFull,
    #[error("too many uploads of this owner, or of all owners together, are under way")]
    Busy,
    #[error(transparent)]
    Quota(OverQuota),
    #[error("the server cannot store it at this moment; nothing of the upload was kept")]
    Spool(#[source] std::io::Error),
    #[error("the server cannot store it at this moment; nothing of the upload was kept")]
    Store(#[source] StoreError),
}

impl UploadError {
    /// The label it is counted under.
    pub(crate) fn reason(&self) -> UploadRefusal {
        match self {
            Self::TooLarge { .. } => UploadRefusal::TooLarge,
            Self::Truncated | Self::Paused | Self::Slow => UploadRefusal::Incomplete,
            Self::Hash { .. } => UploadRefusal::Hash,
            Self::Package(_) => UploadRefusal::Package,
            Self::DiskFull => UploadRefusal::DiskFull,
            Self::Busy => UploadRefusal::Busy,
            Self::Quota(_) => UploadRefusal::Quota,
            Self::Spool(_) | Self::Store(_) => UploadRefusal::Storage,
        }
    }

    fn spool(error: std::io::Error) -> Self {
        if is_full(&error) {
            Self::DiskFull
        } else {
            Self::Spool(error)
        }
    }

    fn store(error: StoreError) -> Self {
        if is_full(&error) {
            Self::DiskFull
        } else {
            Self::Store(error)
        }
    }
}

/// An upload that is whole and has the right hash.
#[derive(Debug)]
pub(crate) struct Spooled {
    file: std::fs::File,
    bytes: u64,
    hash: PackageId,
    party: Party,
    _place: Place,
}

impl Packages {
    /// Receives an upload of `declared` bytes, if the client declared a length. Of a member, `address` is where it
    /// comes from.
    pub(crate) async fn receive<E>(
        &self,
        (shelf, party, address): (Shelf, Party, IpAddr),
        hash: PackageId,
        declared: Option<u64>,
        mut body: impl Stream<Item = Result<Bytes, E>> + Unpin,
    ) -> Result<Spooled, UploadError> {
        let limit = self.limit;
        if declared.is_some_and(|bytes| bytes > limit) {
            return Err(UploadError::TooLarge { limit });
        }
        // Before any of it is received; it is looked at again before it is stored.
        let expected = Owned {
            sha256: hash,
            bytes: declared.unwrap_or(1),
            put: now(),
        };
        self.within_quota(shelf, expected).await?;
        self.within_space(expected.bytes)?;
        let place = timeout(RECEIVED_WITHIN, async {
            // So no member takes both places of a call.
            let alone = match party.call {
                Some(call) => Some(self.members.lock((call, network_prefix(address))).await),
                None => None,
            };
            Some((alone, self.uploads.take(party).await?))
        });
        let (_alone, place) = place.await.ok().flatten().ok_or(UploadError::Busy)?;
        let file = tempfile::tempfile_in(&self.spool).map_err(UploadError::spool)?;
        let mut file = tokio::fs::File::from_std(file);
        let mut hasher = PackageHasher::default();
        let (mut bytes, mut looked_at) = (0u64, 0u64);
        let begun = Instant::now();
        loop {
            let slow = begun + SLOW_AT_FIRST + Duration::from_secs(bytes / u64::from(SLOWEST));
            let chunk = tokio::select! {
                chunk = body.next() => chunk,
                () = tokio::time::sleep(self.pause) => return Err(UploadError::Paused),
                () = tokio::time::sleep_until(slow) => return Err(UploadError::Slow),
                () = place.is_withdrawn() => return Err(UploadError::Busy),
            };
            let Some(chunk) = chunk else { break };
            let chunk = chunk.map_err(|_| UploadError::Truncated)?;
            bytes = bytes.saturating_add(chunk.len() as u64);
            self.metrics.bytes_up.inc_by(chunk.len() as u64);
            if bytes > limit {
                return Err(UploadError::TooLarge { limit });
            }
            // A body may have declared no length, and other uploads take space meanwhile.
            if bytes - looked_at >= LOOK_AGAIN {
                self.within_space(0)?;
                looked_at = bytes;
            }
            hasher.update(&chunk);
            file.write_all(&chunk).await.map_err(UploadError::spool)?;
        }
        file.flush().await.map_err(UploadError::spool)?;
        let found = hasher.finish();
        if found != hash {
            return Err(UploadError::Hash { found });
        }
        Ok(Spooled {
            file: file.into_std().await,
            bytes,
            hash,
            party,
            _place: place,
        })
    }

    /// Checks that an upload is an avatar package, and stores it on the shelf. True if it was not there yet. On a full shelf of members others make room,
    /// of those that are not `shown` the oldest first.
    pub(crate) async fn keep(
        &self,
        shelf: Shelf,
        upload: Spooled,
        shown: &HashSet<PackageId>,
    ) -> Result<bool, UploadError> {
        let mut made_room = Vec::new();
        let kept = self.keep_owned(shelf, upload, shown, &mut made_room).await;
        for hash in made_room {
            log::info!("package {hash} made room for another member's");
            let _lock = self.hashes.lock(hash).await;
            if let Err(left) = self.remove_unowned(hash).await {
                log::warn!("the bytes of package {hash} stay until the next start: {left}");
            }
        }
        kept
    }

    /// The same, but that the bytes of what `made_room` are still there: who has the lock of one hash waits for no other.
    async fn keep_owned(
        &self,
        shelf: Shelf,
        upload: Spooled,
        shown: &HashSet<PackageId>,
        made_room: &mut Vec<PackageId>,
    ) -> Result<bool, UploadError> {
        let owner = shelf.id();
        let (upload, _lock) = self.checked(upload).await?;
        let hash = upload.hash;
        let record = record(hash, owner);
        let known = {
            let _lock = self.owners.lock(owner).await;
            let owned = Owned {
                sha256: hash,
                bytes: upload.bytes,
                put: now(),
            };
            self.within_quota(shelf, owned).await?;
            let room = self.make_room(shelf, owned, shown, made_room).await;
            room.map_err(UploadError::store)?;
            let head = self.store.size(&record).await;
            let known = head.map_err(UploadError::store)?.is_some();
            if !known {
                let put = self.store.put_name(&record).await;
                put.map_err(UploadError::store)?;
            }
            let said = self.own(owner, owned).await;
            said.map_err(UploadError::store)?;
            known
        };
        let stored = self.keep_bytes(upload).await;
        if let Err(e) = stored {
            // Unless the owner has it from before, in which case the bytes may be there all the same.
            if !known && let Err(left) = self.disown(owner, hash).await {
                log::warn!("the record of a package that could not be stored stays: {left}");
            }
            return Err(e);
        }
        if !known {
            self.metrics.packages_stored.inc();
        }
        Ok(!known)
    }

    /// The upload, once its bytes are known to be a package, with its hash locked. Bytes that are in the store have been checked, whoever put
    /// them; of several uploads of the same bytes one is checked, and the others wait for it.
    async fn checked(
        &self,
        upload: Spooled,
    ) -> Result<(Spooled, Held<'_, PackageId>), UploadError> {
        // Without a place: whoever checks the same bytes now is waited for.
        let lock = self.hashes.lock(upload.hash).await;
        if self.has_bytes(&upload).await? {
            return Ok((upload, lock));
        }
        // Who has a lock never waits for a place.
        drop(lock);
        let place = self
            .checks
            .take(upload.party)
            .await
            .ok_or(UploadError::Busy)?;
        let lock = self.hashes.lock(upload.hash).await;
        if self.has_bytes(&upload).await? {
            return Ok((upload, lock));
        }
        self.metrics.packages_checked.inc();
        let upload = check(upload, place).await?;
        Ok((upload, lock))
    }

    async fn within_quota(&self, shelf: Shelf, new: Owned) -> Result<(), UploadError> {
        match self.over_quota(shelf, new).await {
            Ok(None) => Ok(()),
            Ok(Some(over)) => Err(UploadError::Quota(over)),
            Err(error) => Err(UploadError::store(error)),
        }
    }

    fn within_space(&self, bytes: u64) -> Result<(), UploadError> {
        let has_room = self.space.has_room(bytes);
        has_room.then_some(()).ok_or(UploadError::DiskFull)
    }

    async fn has_bytes(&self, upload: &Spooled) -> Result<bool, UploadError> {
        let size = self.store.size(&package(upload.hash)).await;
        Ok(size.map_err(UploadError::store)? == Some(upload.bytes))
    }

    async fn keep_bytes(&self, upload: Spooled) -> Result<(), UploadError> {
        if self.has_bytes(&upload).await? {
            return Ok(());
        }
        let Spooled {
            file, bytes, hash, ..
        } = upload;
        self.within_space(bytes)?;
        let to = package(hash);
        let put = self.store.put(&to, file).await;
        put.map_err(UploadError::store)?;
        let size = self.store.size(&to).await.map_err(UploadError::store)?;
        if size == Some(bytes) {
            self.space.add(bytes);
            Ok(())
        } else {
            // Another instance removed it, for its last owner there, in just this moment.
            let gone = std::io::Error::new(ErrorKind::NotFound, "removed while it was stored");
            Err(UploadError::Spool(gone))
        }
    }
}

/// Reads the package as a receiver would. It takes memory in proportion to the package, so `place` bounds how many are
/// checked at once.
async fn check(mut upload: Spooled, place: Place) -> Result<Spooled, UploadError> {
    let checked = tokio::task::spawn_blocking(move || {
        let _place = place;
        upload.file.rewind().map_err(UploadError::spool)?;
        Avatar::read(BufReader::new(&upload.file)).map_err(UploadError::Package)?;
        Ok(upload)
    })
    .await;
    checked.unwrap_or_else(|e| Err(UploadError::Spool(std::io::Error::other(e))))
}

/// Whether the disk, or what of it the server may use, is full.
fn is_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut next = Some(error);
    while let Some(error) = next {
        if let Some(io) = error.downcast_ref::<std::io::Error>() {
            let full = [
                ErrorKind::StorageFull,
                ErrorKind::QuotaExceeded,
                ErrorKind::FileTooLarge,
            ];
            if full.contains(&io.kind()) {
                return true;
            }
            // An io::Error that wraps another error does not name it as its source.
            if let Some(inner) = io.get_ref()
                && is_full(inner)
            {
                return true;
            }
        }
        next = error.source();
    }
    false
}

/// An error with what caused it, in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        next = cause.source();
    }
    text
}
