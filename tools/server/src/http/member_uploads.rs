//! How many packages the members of a call may put: what they put takes the place of what others of the owner's calls have put, and costs the server time.

use super::HttpError;
use crate::Id;
use crate::token::Claims;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Packages of one call: three for each of eight people, who may come back with another avatar.
const PER_CALL: u32 = 24;

/// Uploads of one call that are begun, whatever becomes of them: what is refused has been received, too.
const TRIES_PER_CALL: u32 = 4 * PER_CALL;

/// Calls that are counted at once.
const CALLS: usize = 4096;

/// The packages that calls' members have put here. Each instance counts its own.
#[derive(Debug, Default)]
pub(crate) struct MemberUploads(Mutex<HashMap<Id, Count>>);

#[derive(Debug)]
struct Count {
    /// Stored, or being received.
    put: u32,
    /// Begun.
    tried: u32,
    /// When the call's token is no longer valid, Unix seconds.
    expires: u64,
}

impl MemberUploads {
    /// Counts one upload of a member's, until it turns out that nothing is stored.
    ///
    /// # Errors
    /// If the call has had all of its own.
    pub(super) fn begin(
        self: &Arc<Self>,
        claims: &Claims,
        now: u64,
    ) -> Result<MemberUpload, HttpError> {
        let mut calls = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if calls.len() >= CALLS {
            calls.retain(|_, count| count.expires > now);
        }
        if calls.len() >= CALLS && !calls.contains_key(&claims.room()) {
            return Err(HttpError::CallUploads { most: PER_CALL });
        }
        let count = calls.entry(claims.room()).or_insert(Count {
            put: 0,
            tried: 0,
            expires: claims.expires,
        });
        if count.put >= PER_CALL || count.tried >= TRIES_PER_CALL {
            return Err(HttpError::CallUploads { most: PER_CALL });
        }
        count.put += 1;
        count.tried += 1;
        Ok(MemberUpload {
            uploads: Arc::clone(self),
            call: claims.room(),
            is_stored: false,
        })
    }
}

/// An upload of a member's. Dropped before it is stored, also where the client went away, it leaves room for another.
#[derive(Debug)]
pub(super) struct MemberUpload {
    uploads: Arc<MemberUploads>,
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
        let mut calls = (self.uploads.0.lock()).unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = calls.get_mut(&self.call) {
            count.put = count.put.saturating_sub(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::token::Role;

    #[test]
    fn a_call_puts_so_many_packages_and_a_full_table_forgets_calls_that_are_over() {
        let uploads = Arc::<MemberUploads>::default();
        let owner = Id::of_owner("ada");
        let member = |number: u64, expires| {
            let mut call = [0; 16];
            call[..8].copy_from_slice(&number.to_le_bytes());
            Claims::in_room(Role::Member, owner, Id::from_bytes(call), expires).expect("random")
        };
        let first = member(0, 100);
        for _ in 0..PER_CALL {
            uploads.begin(&first, 0).expect("one of its own").stored();
        }
        assert!(uploads.begin(&first, 0).is_err(), "one too many");
        let other = member(CALLS as u64 + 1, 50);
        for _ in 0..TRIES_PER_CALL {
            // Each ends before it is stored, and leaves room.
            drop(uploads.begin(&other, 0).expect("in place of a failed one"));
        }
        assert!(uploads.begin(&other, 0).is_err(), "too many were tried");
        for number in 1..CALLS as u64 - 1 {
            let begun = uploads.begin(&member(number, 50), 0);
            begun.expect("another call's").stored();
        }
        let late = member(CALLS as u64, 200);
        assert!(uploads.begin(&late, 49).is_err(), "the table is full");
        assert!(uploads.begin(&late, 50).is_ok(), "others are over");
        assert!(uploads.begin(&first, 50).is_err(), "the first one is not");
    }
}
