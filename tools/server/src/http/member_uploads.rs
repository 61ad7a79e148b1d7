//! How many packages the members of a call may put: what they put takes the place of what others of the owner's calls have put, and costs the server time.
//!
//! Everything is counted within the call's owner, so that no owner's calls use up what the members of another owner's
//! calls may put; and uploads that were begun are counted by address within the call, so that no member uses up those
//! of another.

use super::HttpError;
use super::rate_limit::{Pace, retry_after_s};
use crate::Id;
use crate::token::Claims;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use turn_server::network_prefix;

/// Packages of one call: three for each of eight people, who may come back with another avatar.
const PER_CALL: u32 = 24;

/// Uploads that one address may begin in one call, whatever becomes of them: what is refused has been received, too. So
/// many at once, and then one a minute.
const TRIES: u32 = 96;
const TRY: Pace = Pace::new(Duration::from_secs(60), TRIES);

/// Calls of one owner that are counted at once. One more takes the place of the call that ends first: all of them share
/// their owner's quota in any case.
const CALLS_PER_OWNER: usize = 1024;

/// Addresses in calls of one owner whose tries are counted at once. One more takes the place of the one that has the
/// most tries left.
const TRIED_PER_OWNER: usize = 4096;

/// The packages that calls' members have put here. Each instance counts its own.
#[derive(Debug, Default)]
pub(crate) struct MemberUploads(Mutex<HashMap<Id, OfOwner>>);

#[derive(Debug, Default)]
struct OfOwner {
    /// Calls of which packages are stored or being received.
    calls: HashMap<Id, Count>,
    /// By address and call: when the next try would be due, if tries came evenly. In the past, it says nothing.
    tried: HashMap<(IpAddr, Id), Instant>,
}

#[derive(Debug)]
struct Count {
    /// Stored, or being received.
    put: u32,
    /// When the call's token is no longer valid, Unix seconds.
    expires: u64,
}

impl OfOwner {
    fn forget_over(&mut self, now: u64, at: Instant) {
        self.calls.retain(|_, count| count.expires > now);
        self.tried.retain(|_, due| *due > at);
    }

    fn is_empty(&self) -> bool {
        self.calls.is_empty() && self.tried.is_empty()
    }

    /// Makes room for a try of another address or call, and for another call.
    fn make_room(&mut self, call: Id, tries: (IpAddr, Id), now: u64, at: Instant) {
        let calls = self.calls.len() >= CALLS_PER_OWNER && !self.calls.contains_key(&call);
        let tried = self.tried.len() >= TRIED_PER_OWNER && !self.tried.contains_key(&tries);
        if !calls && !tried {
            return;
        }
        self.forget_over(now, at);
        if self.calls.len() >= CALLS_PER_OWNER {
            let first = self.calls.iter().min_by_key(|(_, count)| count.expires);
            if let Some(call) = first.map(|(call, _)| *call) {
                self.calls.remove(&call);
            }
        }
        if self.tried.len() >= TRIED_PER_OWNER {
            let first = self.tried.iter().min_by_key(|(_, due)| **due);
            if let Some(tries) = first.map(|(tries, _)| *tries) {
                self.tried.remove(&tries);
            }
        }
    }
}

impl MemberUploads {
    /// Counts one upload of a member's, from `address`, until it turns out that nothing is stored.
    ///
    /// # Errors
    /// If the call has as many packages as it may have, or too many were tried from this address.
    pub(super) fn begin(
        self: &Arc<Self>,
        claims: &Claims,
        address: IpAddr,
        now: u64,
    ) -> Result<MemberUpload, HttpError> {
        self.begin_at(claims, address, now, Instant::now())
    }

    fn begin_at(
        self: &Arc<Self>,
        claims: &Claims,
        address: IpAddr,
        now: u64,
        at: Instant,
    ) -> Result<MemberUpload, HttpError> {
        let (owner, call) = (claims.owner, claims.room());
        let tries = (network_prefix(address), call);
        let mut owners = self.locked();
        let here = owners.entry(owner).or_default();
        here.make_room(call, tries, now, at);
        let due = here.tried.entry(tries).or_insert(at);
        TRY.take(due, at).map_err(|wait| {
            let retry_after_s = retry_after_s(wait);
            HttpError::TooManyTries { retry_after_s }
        })?;
        let count = here.calls.entry(call).or_insert(Count {
            put: 0,
            expires: claims.expires,
        });
        if count.put >= PER_CALL {
            return Err(HttpError::CallUploads { most: PER_CALL });
        }
        count.put += 1;
        Ok(MemberUpload {
            uploads: Arc::clone(self),
            owner,
            call,
            is_stored: false,
        })
    }

    /// Forgets calls that are over, and addresses whose tries have all come back.
    pub(crate) fn forget_over(&self, now: u64) {
        let at = Instant::now();
        let mut owners = self.locked();
        owners.retain(|_, owner| {
            owner.forget_over(now, at);
            !owner.is_empty()
        });
        owners.shrink_to_fit();
    }

    fn locked(&self) -> MutexGuard<'_, HashMap<Id, OfOwner>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An upload of a member's. Dropped before it is stored, also where the client went away, it leaves room for another.
#[derive(Debug)]
pub(super) struct MemberUpload {
    uploads: Arc<MemberUploads>,
    owner: Id,
    call: Id,
    is_stored: bool,
}

impl MemberUpload {
    /// It stays counted.
    pub(super) fn stored(mut self) {
        self.is_stored = true;
    }
}

impl Drop for MemberUpload {
    fn drop(&mut self) {
        if self.is_stored {
            return;
        }
        let mut owners = self.uploads.locked();
        let Some(here) = owners.get_mut(&self.owner) else {
            return;
        };
        if let Some(count) = here.calls.get_mut(&self.call) {
            count.put = count.put.saturating_sub(1);
            if count.put == 0 {
                here.calls.remove(&self.call);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::token::Role;
    use std::net::Ipv4Addr;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
    const THERE: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 0, 2, 1));

    fn member(owner: &str, number: usize, expires: u64) -> Claims {
        let mut call = [0; 16];
        call[..8].copy_from_slice(&(number as u64).to_le_bytes());
        let owner = Id::of_owner(owner);
        Claims::in_room(Role::Member, owner, Id::from_bytes(call), expires).expect("random")
    }

    #[test]
    fn a_call_has_so_many_packages_and_a_failed_upload_leaves_no_entry() {
        let uploads = Arc::<MemberUploads>::default();
        let first = member("ada", 0, 100);
        for _ in 0..PER_CALL {
            uploads
                .begin(&first, HERE, 0)
                .expect("of the call")
                .stored();
        }
        let refused = uploads.begin(&first, THERE, 0).expect_err("one too many");
        assert!(matches!(refused, HttpError::CallUploads { .. }));
        let other = member("ada", 1, 100);
        drop(uploads.begin(&other, HERE, 0).expect("another call"));
        let calls = uploads.locked()[&first.owner].calls.len();
        assert_eq!(calls, 1, "the call that has packages");
        uploads.forget_over(100);
        assert!(uploads.locked()[&first.owner].calls.is_empty(), "over");
    }

    #[test]
    fn tries_are_counted_by_address_and_call_and_come_back_one_a_minute() {
        let uploads = Arc::<MemberUploads>::default();
        let (call, other) = (member("ada", 0, 100), member("ada", 1, 100));
        let begun = Instant::now();
        let tried = |claims, address, s| {
            let at = begun + Duration::from_secs(s);
            uploads.begin_at(claims, address, 0, at).map(drop)
        };
        for _ in 0..TRIES {
            tried(&call, HERE, 0).expect("of the burst");
        }
        let refused = tried(&call, HERE, 0).expect_err("one too many");
        let HttpError::TooManyTries { retry_after_s } = refused else {
            panic!("{refused}");
        };
        assert!((60..=61).contains(&retry_after_s), "{retry_after_s}");
        tried(&call, THERE, 0).expect("another address");
        tried(&other, HERE, 0).expect("another call");
        tried(&call, HERE, 60).expect("a minute later");
        tried(&call, HERE, 60).expect_err("no second one");
    }

    #[test]
    fn an_owner_with_more_calls_than_are_counted_takes_no_place_of_another_owner() {
        let uploads = Arc::<MemberUploads>::default();
        let late = u64::try_from(CALLS_PER_OWNER).expect("small") * 8;
        for number in 0..TRIED_PER_OWNER + 8 {
            let call = member("eve", number, late - number as u64 % 8);
            uploads.begin(&call, HERE, 0).expect("a call").stored();
        }
        {
            let owners = uploads.locked();
            let eve = &owners[&Id::of_owner("eve")];
            let counted = (eve.calls.len(), eve.tried.len());
            assert_eq!(counted, (CALLS_PER_OWNER, TRIED_PER_OWNER));
        }
        let ada = member("ada", 0, 100);
        assert!(uploads.begin(&ada, HERE, 0).is_ok(), "another owner's");
    }
}
