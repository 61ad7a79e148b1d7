//! The keys that sit in a call. A member answers the viewers alone whose key is among them, and ends the connections of
//! those whose key is no longer.

use identity::PublicKey;
use link_protocol::limits::SEAT_KEPT;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Instant, timeout};

/// A key counts as seated for so long after it was seen in a seat last: as long as the server keeps a seat.
const SEATED: Duration = SEAT_KEPT;

/// For the server to say who sits in the call: less than a viewer waits for its answer.
const ASKED_WITHIN: Duration = Duration::from_secs(3);

/// Time between two answers of the server, beyond which it counts for no key: while the server cannot be reached,
/// members cannot show that they are in the call, and they come back one after another.
const UNANSWERED: Duration = Duration::from_secs(2);

/// More seats than any call has, and those whose occupants have just changed.
const MOST: usize = 64;

/// The keys that sit in a call, each with the time at which it was seen last.
#[derive(Debug)]
pub(super) struct Seated(watch::Sender<Seen>);

#[derive(Debug, Default)]
struct Seen {
    keys: Vec<(PublicKey, Instant)>,
    /// When the server was asked for the newest of them.
    asked: Option<Instant>,
}

impl Seen {
    fn has(&self, key: PublicKey, now: Instant) -> bool {
        let is_here = |(seated, at): &(PublicKey, Instant)| {
            *seated == key && now.duration_since(*at) <= SEATED
        };
        self.keys.iter().any(is_here)
    }
}

impl Default for Seated {
    fn default() -> Self {
        Self(watch::Sender::new(Seen::default()))
    }
}

impl Seated {
    /// The server, which was asked at `asked`, says that these keys sit in the call now.
    pub(super) fn note(&self, asked: Instant, keys: &[PublicKey]) {
        self.0.send_modify(|seen| {
            let gap = seen
                .asked
                .map_or(Duration::ZERO, |last| asked.duration_since(last));
            let unanswered = gap.saturating_sub(UNANSWERED);
            let is_kept = |(key, at): &(PublicKey, Instant)| {
                !keys.contains(key) && asked.duration_since(*at) <= SEATED
            };
            let mut before = std::mem::take(&mut seen.keys);
            before.iter_mut().for_each(|(_, at)| *at += unanswered);
            // Those of now first: keys that come and go push out one another, and no key that sits in the call.
            seen.keys = keys.iter().map(|key| (*key, asked)).collect();
            seen.keys.extend(before.into_iter().filter(is_kept));
            seen.keys.truncate(MOST);
            seen.asked = Some(asked);
        });
    }

    /// Whether this key sits in the call, or did a short time ago.
    pub(super) fn has(&self, key: PublicKey) -> bool {
        self.0.borrow().has(key, Instant::now())
    }

    /// The same for one that may have sat down just now: as the server says that is asked from now on. Nothing if it
    /// does not answer in time.
    pub(super) async fn has_or_will(&self, key: PublicKey) -> Option<bool> {
        let since = Instant::now();
        let mut seen = self.0.subscribe();
        let is_answered = |seen: &Seen| {
            seen.has(key, Instant::now()) || seen.asked.is_some_and(|asked| asked >= since)
        };
        // Not by what `wait_for` returns, which holds a lock.
        let answered = timeout(ASKED_WITHIN, async {
            seen.wait_for(is_answered).await.map(|_| ())
        });
        let is_answered = matches!(answered.await, Ok(Ok(())));
        is_answered.then(|| self.has(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;

    fn key(number: u8) -> PublicKey {
        Identity::from_seed(&[number; 32]).expect("a key").public()
    }

    #[test]
    fn a_key_counts_as_seated_until_its_seat_would_not_be_kept_any_longer() {
        let seated = Seated::default();
        assert!(!seated.has(key(1)), "nobody sits there yet");
        let begun = Instant::now();
        let last = begun + SEATED;
        let over = last + Duration::from_millis(1);
        let sits = |number, at| seated.0.borrow().has(key(number), at);
        seated.note(begun, &[key(1), key(2)]);
        assert!(sits(1, begun) && sits(2, begun) && !sits(3, begun));
        for second in 1..=10 {
            seated.note(begun + Duration::from_secs(second), &[key(2)]);
        }
        assert!(sits(1, last), "for as long as the server keeps a seat");
        assert!(!sits(1, over) && sits(2, over));
        seated.note(over, &[]);
        let left = seated.0.borrow().keys.len();
        assert_eq!(left, 1, "who is gone is forgotten");
    }

    #[test]
    fn time_in_which_the_server_does_not_answer_counts_for_no_key() {
        let seated = Seated::default();
        let begun = Instant::now();
        seated.note(begun, &[key(1), key(2)]);
        let back = begun + Duration::from_secs(60);
        seated.note(back, &[key(2)]);
        let sits = |number, at| seated.0.borrow().has(key(number), at);
        let last = back + SEATED - UNANSWERED;
        assert!(sits(1, last), "the member is not back yet");
        assert!(!sits(1, last + Duration::from_millis(1)));
        // A slow server keeps nobody seated.
        let slow = Duration::from_millis(2500);
        let answers = (1..=30).map(|answer| back + slow * answer);
        answers.for_each(|asked| seated.note(asked, &[]));
        assert!(seated.0.borrow().keys.is_empty());
    }

    #[test]
    fn an_occupant_who_changes_keys_pushes_out_no_key_that_sits_in_the_call() {
        let seated = Seated::default();
        let asked = Instant::now();
        for round in 0..60 {
            let hers = [2, 3, 4].map(|seat| key(seat + 3 * round));
            seated.note(asked, &[&hers[..], &[key(1)]].concat());
            assert!(seated.0.borrow().has(key(1), asked), "after {round}");
        }
        assert_eq!(seated.0.borrow().keys.len(), MOST, "bounded");
    }

    #[tokio::test]
    async fn a_newcomer_is_waited_for_until_the_server_has_been_asked_again() {
        let seated = Seated::default();
        let before = Instant::now();
        tokio::time::sleep(Duration::from_millis(10)).await;
        let (bob, eve, ()) = tokio::join!(
            seated.has_or_will(key(1)),
            seated.has_or_will(key(2)),
            async {
                seated.note(before, &[]);
                tokio::time::sleep(Duration::from_millis(50)).await;
                seated.note(Instant::now(), &[key(1)]);
            }
        );
        assert_eq!(
            bob,
            Some(true),
            "the answer to the earlier question says nothing of him"
        );
        assert_eq!(eve, Some(false), "she sits nowhere");
    }

    #[tokio::test]
    async fn a_server_that_does_not_answer_refuses_nobody_for_good() {
        assert_eq!(Seated::default().has_or_will(key(1)).await, None);
    }
}
