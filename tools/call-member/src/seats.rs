//! The seats of a call as the roster knows them: who sits there, what they are called, and how long one in whom something failed has to wait.

use app_session::call::CallWatch;
use identity::PublicKey;
use link_protocol::calls::Taken;
use link_protocol::data_channel::PersonState;
use link_protocol::{Name, PersonName};
use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

/// From the first failure of a person to be shown until whoever sits there is tried again once more, and the longest pause there is: each doubles the one
/// before.
const AGAIN: Duration = Duration::from_secs(3);
const AGAIN_MOST: Duration = Duration::from_secs(60);

/// A seat in which someone stayed for so long, or nothing failed for so long, has no trouble any more.
pub(crate) const FORGIVEN: Duration = Duration::from_secs(60);
pub(crate) const FORGOTTEN: Duration = Duration::from_secs(300);

/// What is known of a taken seat.
pub(crate) struct Known {
    pub(crate) name: String,
    pub(crate) taken: Taken,
    /// Their key, as they prove it to all members.
    pub(crate) key: PublicKey,
    pub(crate) watch: CallWatch,
    /// When they were handed over.
    pub(crate) joined: Option<Instant>,
    /// Whether it was told who they are by their key.
    pub(crate) is_introduced: bool,
    /// What was told last, and when.
    pub(crate) state: (PersonState, Option<Instant>),
    /// When bytes came last, and how many there were.
    pub(crate) heard: (Instant, u64),
    /// Whether the server shows the seat as theirs.
    pub(crate) is_seated: bool,
    /// Since when the call with them is over.
    pub(crate) over: Option<Instant>,
}

impl Known {
    /// Someone who was not told of yet.
    pub(crate) fn new(name: String, taken: Taken, key: PublicKey, watch: CallWatch) -> Self {
        Self {
            name,
            taken,
            key,
            watch,
            joined: None,
            is_introduced: false,
            state: (PersonState::default(), None),
            heard: (Instant::now(), 0),
            is_seated: true,
            over: None,
        }
    }
}

/// The people of the call by their seats, and those who could not be shown.
#[derive(Default)]
pub(crate) struct Seats {
    pub(crate) known: HashMap<Name, Known>,
    /// Of which an avatar is being fetched. It may be for one who has left: nothing else is fetched until that ends.
    pub(crate) fetching: HashSet<Name>,
    pub(crate) troubles: HashMap<Name, Trouble>,
    /// Whose occupants prove no key, which was told.
    pub(crate) unproved: HashSet<Name>,
}

/// Of a seat that stayed taken while the call with who sat there was over: the avatar does not load, or there is no room for it. Whoever comes next
/// has to wait, too, for it may be the same one under another name.
pub(crate) struct Trouble {
    pub(crate) times: u32,
    pub(crate) last: Instant,
    /// When to try again.
    pub(crate) again: Instant,
}

/// Has a person who sits there and could not be shown wait, the longer the more often it happened.
pub(crate) fn note_trouble(troubles: &mut HashMap<Name, Trouble>, seat: &Name, now: Instant) {
    let before = troubles.get(seat);
    let times = before.map_or(0, |trouble| trouble.times.saturating_add(1));
    // The first time they may just have come back at once.
    let pause = match times {
        0 => Duration::ZERO,
        _ => (AGAIN * 2u32.saturating_pow(times - 1)).min(AGAIN_MOST),
    };
    let trouble = Trouble {
        times,
        last: now,
        again: now + pause,
    };
    troubles.insert(seat.clone(), trouble);
}

impl Seats {
    /// What a newcomer in the seat of this number is called: as they say, unless that looks like what another one is called, or may be called.
    pub(crate) fn name(&self, taken: &Taken, number: usize) -> String {
        let seat = format!("person {}", number + 1);
        let Some(name) = &taken.person else {
            return seat;
        };
        let seen = name.as_seen();
        let names = self
            .known
            .values()
            .filter_map(|other| other.taken.person.as_ref());
        let is_taken = names.map(PersonName::as_seen).any(|other| other == seen);
        if is_taken || seen.contains("person") {
            format!("{name} ({seat})")
        } else {
            name.to_string()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_cannot_be_shown_is_tried_again_ever_more_rarely() {
        let mut troubles = HashMap::new();
        let seat = Name::of_id([1; 16]);
        let begun = Instant::now();
        let pauses: Vec<u64> = (0..7)
            .map(|_| {
                note_trouble(&mut troubles, &seat, begun);
                troubles[&seat].again.duration_since(begun).as_secs()
            })
            .collect();
        assert_eq!(pauses, [0, 3, 6, 12, 24, 48, 60]);
        let other = Name::of_id([2; 16]);
        note_trouble(&mut troubles, &other, begun);
        assert_eq!(troubles[&other].times, 0, "of each seat by itself");
    }

    #[test]
    fn nobody_is_called_as_another_one_is_or_may_be() {
        let taken = |name: Option<&str>| {
            Taken {
            announcement: serde_json::from_str(
                r#"{"avatar": {"sha256": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", "bytes": 3},
                "channel": "unreliable", "codec": "compact", "rate_hz": 30.0}"#,
            )
            .expect("an announcement"),
            person: name.map(|name| name.parse().expect("a name")),
            proof: None,
        }
        };
        let mut seats = Seats::default();
        let mut call = |number: u8, name: Option<&str>| {
            let taken = taken(name);
            let name = seats.name(&taken, usize::from(number));
            let identity = identity::Identity::from_seed(&[number; 32]).expect("a key");
            let key = identity.public();
            let known = Known::new(name.clone(), taken, key, CallWatch::default());
            seats.known.insert(Name::of_id([number; 16]), known);
            name
        };
        let names = [
            (None, "person 1"),
            (Some("Ada"), "Ada"),
            (Some("ADA"), "ADA (person 3)"),
            (Some("Person 1"), "Person 1 (person 4)"),
            (Some("Ada (person 2)"), "Ada (person 2) (person 5)"),
            (Some("李白"), "李白"),
            (Some("李\u{fe00}白"), "李\u{fe00}白 (person 7)"),
        ];
        for (number, (name, called)) in (0..).zip(names) {
            assert_eq!(call(number, name), called);
        }
    }
}
