//! People side by side, for a picture without a viewer in the room.

use super::people::APART;
use super::place::Place;
use super::standing::Standing;
use glam::{Affine3A, Vec2};

/// People on a line along x through the origin, from left to right as a camera sees them that looks along -z, [`APART`] from one another,
/// each facing +z. A person gets a place when their pose is first known, and walks from there as they walk.
#[derive(Debug, Clone, Default)]
pub struct Lineup {
    places: Vec<Option<Place>>,
    world_from_person: Vec<Affine3A>,
}

impl Lineup {
    /// People by a number that each keeps, `None` while there is no pose of one: each one's rigid world_from_person. Allocates only where
    /// there are other people than before.
    pub fn update(&mut self, people: &[Option<Standing>]) -> &[Affine3A] {
        self.places.resize(people.len(), None);
        let leftmost = people.len().saturating_sub(1) as f32 * APART / -2.0;
        for (k, (place, standing)) in self.places.iter_mut().zip(people).enumerate() {
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
}
