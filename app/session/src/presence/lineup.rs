//! People side by side, for a picture without a viewer in the room.

use super::people::APART;
use super::place::Place;
use super::standing::Standing;
use glam::{Affine3A, Vec2};

/// People on a line along x through the origin, from left to right as a camera sees them that looks along -z, [`APART`] from one another,
/// each facing +z. A person gets a place when their pose is first known, and walks from there as they walk; when there are others than before, everyone
/// who is there gets a place anew.
#[derive(Debug, Clone, Default)]
pub struct Lineup {
    present: Vec<bool>,
    places: Vec<Option<Place>>,
    world_from_person: Vec<Affine3A>,
}

impl Lineup {
    /// People by a number that each keeps, `None` while there is no pose of one, and whether each is there at all: each one's rigid
    /// world_from_person. Allocates only where there are other people than before.
    pub fn update(&mut self, people: &[Option<Standing>], present: &[bool]) -> &[Affine3A] {
        if self.present != present {
            self.present.clear();
            self.present.extend_from_slice(present);
            self.places.clear();
        }
        self.places.resize(people.len(), None);
        let leftmost = self.count().saturating_sub(1) as f32 * APART / -2.0;
        let there = (self.places.iter_mut().zip(people))
            .zip(&self.present)
            .filter_map(|(person, present)| present.then_some(person));
        for (k, (place, standing)) in there.enumerate() {
            if let (None, Some(standing)) = (&place, standing) {
                let spot = Vec2::new(leftmost + k as f32 * APART, 0.0);
                *place = Some(Place::on(spot, Vec2::Y, standing));
            }
        }
        self.world_from_person.clear();
        let places = self.places.iter();
        self.world_from_person
            .extend(places.map(|place| (*place).unwrap_or(Place::UNKNOWN).floor_from_person()));
        &self.world_from_person
    }

    /// How many people are there.
    #[must_use]
    pub fn count(&self) -> usize {
        self.present.iter().filter(|present| **present).count()
    }
}
