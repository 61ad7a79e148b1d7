//! Where people's voices come from: from their mouths, as the head of the viewer has them, who is the listener too.

use super::LiveSession;
use glam::{Affine3A, Vec3};
use renderer_splat::camera::Camera;
use spatial_sound::REFERENCE_DISTANCE;
use spmm3::{Joint, MotionParams, Skeleton};

/// From the jaw's joint, below the ears, to the lips, in the head's axes, metres.
const LIPS: Vec3 = Vec3::new(0.0, -0.02, 0.09);

impl LiveSession<'_> {
    /// Has each voice come from its mouth in the picture that was begun, for a viewer whose head is there: rigid, metres.
    pub(crate) fn place_voices(&self, head_from_world: Affine3A, places: &[Affine3A]) {
        self.place_each(places, |mouth| head_from_world.transform_point3(mouth));
    }

    /// The same, for a viewer before a flat picture, seen from `cameras`: voices come from where people are seen, and are as loud as those of people nearby however
    /// far the camera stands.
    pub(super) fn place_voices_in_picture(&self, cameras: &[Camera], places: &[Affine3A]) {
        let Some(camera) = cameras.first() else {
            return;
        };
        self.place_each(places, |mouth| {
            let seen = camera.camera_from_world.transform_point3(mouth);
            seen.normalize_or(Vec3::NEG_Z) * REFERENCE_DISTANCE
        });
    }

    fn place_each(&self, places: &[Affine3A], head_from_mouth: impl Fn(Vec3) -> Vec3) {
        let seen = self.people.iter().zip(self.lanes.poses()).zip(places);
        for (((person, motion), world_from_person), attends) in seen.zip(self.lanes.attending()) {
            // The voice of one who has left may be another one's by now, who has the seat.
            let Some(voice) = person.voice.as_ref().filter(|_| attends) else {
                continue;
            };
            let mouth = motion.map(|motion| {
                let mouth = mouth(&person.avatar.skeleton, motion);
                head_from_mouth(world_from_person.transform_point3(mouth))
            });
            voice.place(mouth.map(|mouth| mouth.to_array()));
        }
    }
}

/// In the space of the person's motion, metres.
fn mouth(skeleton: &Skeleton, motion: &MotionParams) -> Vec3 {
    let joints = skeleton.pose(motion);
    let head = joints.person_from_joint[Joint::Head.index()];
    joints.position(Joint::Jaw) + head.transform_vector3(LIPS) + motion.root_translation
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use synthetic_person::{Puppet, PuppetSize};

    #[test]
    fn the_mouth_goes_with_the_head_and_with_the_person() {
        let skeleton = Puppet::new(PuppetSize::SMALL).skeleton;
        let mut motion = MotionParams::default();
        let rest = mouth(&skeleton, &motion);
        let head = skeleton.rest_positions()[Joint::Head.index()];
        assert!(rest.z > head.z + 0.05, "before the head: {rest} of {head}");
        motion.root_translation = Vec3::new(1.0, 0.0, -2.0);
        motion.set_rotation(
            Joint::Head,
            Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
        );
        let turned = mouth(&skeleton, &motion) - motion.root_translation;
        assert!(
            turned.x > head.x + 0.05 && (turned.y - rest.y).abs() < 1e-4,
            "to the person's left: {turned}"
        );
    }
}
