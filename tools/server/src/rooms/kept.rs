//! Seats of calls that are kept for their occupants for a while after their presence streams have broken: no other
//! member takes the seat of one whose network fails for a moment.

use super::Occupancy;
use crate::Id;
use link_protocol::Name;
use link_protocol::limits::SEAT_KEPT;
use std::collections::HashMap;
use std::time::Instant;

/// The seats that are kept now.
#[derive(Debug, Default)]
pub(super) struct Kept(HashMap<Id, Seat>);

#[derive(Debug)]
struct Seat {
    occupant: Name,
    of: Occupancy,
    until: Instant,
}

impl Kept {
    /// Keeps the seat `room` for its occupant.
    pub(super) fn keep(&mut self, room: Id, occupant: Name, of: Occupancy) {
        self.keep_at(room, occupant, of, Instant::now());
    }

    fn keep_at(&mut self, room: Id, occupant: Name, of: Occupancy, now: Instant) {
        self.0.retain(|_, seat| seat.until > now);
        let until = now + SEAT_KEPT;
        let seat = Seat {
            occupant,
            of,
            until,
        };
        self.0.insert(room, seat);
    }

    /// For whom the seat `room` is kept.
    pub(super) fn occupant(&self, room: Id) -> Option<&Name> {
        self.occupant_at(room, Instant::now())
    }

    fn occupant_at(&self, room: Id, now: Instant) -> Option<&Name> {
        let seat = self.0.get(&room).filter(|seat| seat.until > now);
        seat.map(|seat| &seat.occupant)
    }

    /// The seat is taken again, or free from now on.
    pub(super) fn release(&mut self, room: Id) {
        self.0.remove(&room);
    }

    /// All of them, with their rooms.
    pub(super) fn all(&self) -> impl Iterator<Item = (Id, Occupancy)> {
        let now = Instant::now();
        let kept = self.0.iter().filter(move |(_, seat)| seat.until > now);
        kept.map(|(room, seat)| (*room, seat.of))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_seat_is_kept_for_ten_seconds_and_forgotten_then() {
        let mut kept = Kept::default();
        let [room, other, owner] = [1, 2, 3].map(|number| Id::from_bytes([number; 16]));
        let of = Occupancy {
            owner,
            network: None,
        };
        let ada: Name = "ada".parse().expect("a name");
        let begun = Instant::now();
        kept.keep_at(room, ada.clone(), of, begun);
        let at = |ms| begun + Duration::from_millis(ms);
        assert_eq!(kept.occupant_at(room, at(9_999)), Some(&ada));
        assert_eq!(kept.occupant_at(other, at(0)), None, "another seat");
        assert_eq!(kept.occupant_at(room, at(10_000)), None, "over");
        kept.keep_at(other, ada, of, at(10_000));
        assert_eq!(kept.0.len(), 1, "the first one is forgotten");
        kept.release(other);
        assert!(kept.0.is_empty());
    }
}
