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
    /// The seat's number, from 0.
    pub(crate) number: usize,
    /// What they are called: by their seat, until they have shown a name that they signed.
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
    /// A newcomer in the seat of this number.
    pub(crate) fn new(number: usize, taken: Taken, key: PublicKey, watch: CallWatch) -> Self {
        Self {
            number,
            name: called(None, number, []),
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
    /// The taken seats of the others, and the keys that their occupants prove.
    pub(crate) seated: Vec<(Name, PublicKey)>,
    /// Those of them who have seen this side without being shown.
    pub(crate) unshown: HashMap<PublicKey, Unshown>,
}

/// A member who sees this side and is not shown.
pub(crate) struct Unshown {
    pub(crate) since: Instant,
    /// Whether it was reported.
    pub(crate) is_reported: bool,
}

impl Unshown {
    pub(crate) fn from(since: Instant) -> Self {
        Self {
            since,
            is_reported: false,
        }
    }
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

/// What a person in the seat of this number is called: as they signed, unless that looks like what one of the `others`
/// is called, or may be called.
pub(crate) fn called<'a>(
    signed: Option<&PersonName>,
    number: usize,
    others: impl IntoIterator<Item = &'a PersonName>,
) -> String {
    let seat = format!("person {}", number + 1);
    let Some(name) = signed else {
        return seat;
    };
    let is_taken = others.into_iter().any(|other| other.looks_like(name));
    if is_taken || name.as_seen().iter().any(|seen| seen.contains("person")) {
        format!("{name} ({seat})")
    } else {
        name.to_string()
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
        let mut others: Vec<PersonName> = Vec::new();
        for (number, (name, expected)) in [
            (None, "person 1"),
            (Some("Ada"), "Ada"),
            (Some("ADA"), "ADA (person 3)"),
            (Some("Person 1"), "Person 1 (person 4)"),
            (Some("Ada (person 2)"), "Ada (person 2) (person 5)"),
            (Some("李白"), "李白"),
            (Some("李\u{fe00}白"), "李\u{fe00}白 (person 7)"),
            (Some("\u{410}da"), "\u{410}da (person 8)"),
            (Some("\u{440}erson 2"), "\u{440}erson 2 (person 9)"),
        ]
        .into_iter()
        .enumerate()
        {
            let name: Option<PersonName> = name.map(|name| name.parse().expect("a name"));
            assert_eq!(called(name.as_ref(), number, &others), expected);
            others.extend(name);
        }
    }
}
