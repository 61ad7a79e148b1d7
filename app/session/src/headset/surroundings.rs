//! What is around the people: the viewer's room, a studio or a scene; where they stand in it; their shadows.

use crate::display::LiveSession;
use crate::presence::{Presence, Standing, Viewer, contact_shadow, first_apart};
use app_pipeline::error::ReceiverError;
use glam::Affine3A;
use renderer_openxr::eyes::Surround;
use renderer_splat::gaussian::PackedGaussian;
use std::time::{Duration, Instant};

/// How a surrounding is called in reports.
pub(super) fn name(surround: Surround) -> &'static str {
    match surround {
        Surround::Room => "the viewer's room",
        Surround::Studio => "a studio",
        Surround::Scene => "a scene",
    }
}

/// Each person's place.
#[derive(Debug, Default)]
pub(super) struct Places {
    presence: Presence,
    standing: Vec<Option<Standing>>,
    shadows: Vec<PackedGaussian>,
    /// Of all people, the viewer themselves among them.
    floor_from_person: Vec<Affine3A>,
    updated: Option<Instant>,
}

impl Places {
    /// Puts all people before the viewer again.
    pub(super) fn recentre(&mut self) {
        self.presence.recentre();
    }

    /// Whoever has this number now is another person: they get a place of their own.
    pub(super) fn forget(&mut self, people: &LiveSession<'_>, person: usize) {
        self.presence.forget(person.saturating_sub(people.own));
    }

    /// floor_from_person of the first person whose pose is known, apart from the viewer.
    pub(super) fn of_first(&self) -> Option<Affine3A> {
        let own = (self.floor_from_person.len()).saturating_sub(self.standing.len());
        let first = first_apart(&self.standing, 0)?;
        self.floor_from_person.get(own + first).copied()
    }

    /// Puts all people in their places for the picture that was begun, and their shadows below them.
    pub(super) fn update(
        &mut self,
        people: &mut LiveSession<'_>,
        viewer: &Viewer,
    ) -> Result<(), ReceiverError> {
        let now = Instant::now();
        let elapsed = (self.updated.replace(now))
            .map_or(Duration::ZERO, |last| now.saturating_duration_since(last));
        self.standing.clear();
        // The viewer does not meet themselves.
        let poses = people.lanes.poses().zip(people.people.iter());
        let others = poses.skip(people.own);
        self.standing
            .extend(others.map(|(motion, person)| Standing::of(&person.avatar.skeleton, motion?)));
        let places = self.presence.update(viewer, &self.standing, elapsed);
        self.floor_from_person.clear();
        self.floor_from_person
            .resize(people.own, Affine3A::IDENTITY);
        self.floor_from_person.extend_from_slice(places);
        if let Some(floor_from_head) = viewer.floor_from_head {
            people.place_voices(floor_from_head.inverse(), &self.floor_from_person);
        }
        self.shadows.clear();
        for (person, (floor_from_person, standing)) in places.iter().zip(&self.standing).enumerate()
        {
            people.lanes.place(person + people.own, *floor_from_person);
            if let Some(standing) = standing {
                let shadow = contact_shadow(standing, floor_from_person);
                self.shadows.extend_from_slice(shadow.gaussians());
            }
        }
        people.lanes.set_scenery(&self.shadows)
    }
}
