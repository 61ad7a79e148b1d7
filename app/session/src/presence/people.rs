//! Where each person stands in the viewer's room: before the viewer at first, then where they were put.

use super::grab::Grabs;
use super::place::{DISTANCE, Place, turned};
use super::standing::Standing;
use super::viewer::{View, Viewer};
use glam::{Affine3A, Vec2};
use std::time::Duration;

/// From one person to the next, metres, on every display.
pub const APART: f32 = 0.9;
/// Who joins later does not stand closer to anybody than this, metres.
const CLEAR: f32 = 0.6;
/// Places that are tried to either side for who joins later, half a step each: once around the viewer.
const TRIES: u8 = 11;

/// The remote people's places in the viewer's room.
///
/// A person gets a place when the viewer's head and their own pose are first known: on the floor 1.6 m before the viewer
/// and facing them, several in an arc from left to right, 0.9 m apart. There they stay, or walk as they walk, while the
/// viewer goes about, until a hand puts them elsewhere.
///
/// A hand that closes on a person, or points at them, holds that person: within 0.45 m of the line from pelvis to head.
/// A person who is held goes as the hand goes and turns about y as it turns; 4 m and a full turn a second at most, and
/// no person is taken further than 8 m away. Held by a ray they go as the ray's point on the floor goes, in the measure of
/// their distances, so that they stay where the ray is; from 6 m on, and above the horizon, the ray moves them sideways
/// only, and the hand's way along the floor counts the more the further they are. A hand that is not tracked, or was found
/// again elsewhere, moves no person.
#[derive(Debug, Clone, Default)]
pub struct Presence {
    places: Vec<Option<Place>>,
    floor_from_person: Vec<Affine3A>,
    holding: Grabs,
}

impl Presence {
    /// A room without anybody.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A frame's head, hands and people (by a number that each keeps; `None` while there is no pose of one), so long after
    /// the frame before. Returns each person's rigid floor_from_person. Allocates only where there are other people than
    /// before.
    pub fn update(
        &mut self,
        viewer: &Viewer,
        people: &[Option<Standing>],
        elapsed: Duration,
    ) -> &[Affine3A] {
        self.places.resize(people.len(), None);
        let view = viewer.view();
        if let Some(view) = view {
            self.receive(view, people);
        }
        self.holding.update(
            view.map(|view| view.floor),
            &viewer.hands,
            &mut self.places,
            people,
            elapsed.as_secs_f32(),
        );
        self.floor_from_person.clear();
        let places = self.places.iter();
        self.floor_from_person
            .extend(places.map(|place| (*place).unwrap_or(Place::UNKNOWN).floor_from_person()));
        &self.floor_from_person
    }

    /// Puts all people before the viewer again, at the next [`Self::update`], and out of their hands: for when the room's
    /// origin moved.
    pub fn recentre(&mut self) {
        self.places.fill(None);
        self.holding = Grabs::default();
    }

    /// Whoever has this number now is another person: they get a place of their own at the next [`Self::update`], in nobody's hand.
    pub fn forget(&mut self, person: usize) {
        if let Some(place) = self.places.get_mut(person) {
            *place = None;
        }
        self.holding = Grabs::default();
    }

    /// Gives places to those who have none.
    fn receive(&mut self, view: View, people: &[Option<Standing>]) {
        let step = 2.0 * (APART / (2.0 * DISTANCE)).asin();
        let leftmost = people.len().saturating_sub(1) as f32 * step / 2.0;
        for (k, standing) in people.iter().enumerate() {
            let (Some(standing), Some(None)) = (standing, self.places.get(k)) else {
                continue;
            };
            let to_seat = |angle: f32| turned(view.ahead, angle) * DISTANCE;
            let own = leftmost - k as f32 * step;
            let aside = (1..=TRIES).flat_map(|n| [-1.0, 1.0].map(|side| side * f32::from(n)));
            let angle = std::iter::once(own)
                .chain(aside.map(|halves| own + halves * step / 2.0))
                .find(|angle| self.is_free(view.floor + to_seat(*angle), people))
                .unwrap_or(own);
            let place = Place::on(view.floor + to_seat(angle), -to_seat(angle), standing);
            if let Some(free) = self.places.get_mut(k) {
                *free = Some(place);
            }
        }
    }

    fn is_free(&self, spot: Vec2, people: &[Option<Standing>]) -> bool {
        self.places
            .iter()
            .zip(people)
            .filter_map(|(place, standing)| Some((*place)?.spot(standing.as_ref()?)))
            .all(|other| other.distance(spot) >= CLEAR)
    }
}
