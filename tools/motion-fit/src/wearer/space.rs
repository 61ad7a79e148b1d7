//! From the headset's floor space to motion space: where the wearer began, and how tall they are against the avatar.

use super::{Pose, WearerSample};
use glam::{Affine3A, DQuat, DVec3};
use std::f64::consts::PI;

/// A wearer this much smaller or larger than the avatar, and no more.
const SCALES: [f64; 2] = [0.7, 1.4];
/// How long a greater height has to be held before it is the wearer's own, about, seconds: a hop is none.
const STRETCH_SECONDS: f64 = 0.5;

/// A view looks along -z, the avatar's head along +z; floor and motion space differ by the same half turn.
fn half_turn() -> DQuat {
    DQuat::from_rotation_y(PI)
}

/// The wearer's place of beginning and size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Space {
    /// On the floor, in floor space.
    origin: DVec3,
    /// `motion_from_floor`, but for the origin.
    turn: DQuat,
    /// The wearer's metres in one of the avatar's.
    scale: f64,
    generation: u32,
}

impl Space {
    /// For a wearer who begins with `view`, a pose in floor space. `scale` is that of [`scale_of`], or 1.
    pub(super) fn begin(view: &Affine3A, generation: u32, scale: f64) -> Self {
        let view = pose(view);
        let looked = half_turn() * view.rotation * half_turn();
        let yaw = heading(looked);
        Self {
            origin: DVec3::new(view.position.x, 0.0, view.position.z),
            turn: DQuat::from_rotation_y(-yaw) * half_turn(),
            scale,
            generation,
        }
    }

    /// Whether `sample` is of the same floor space.
    pub(super) fn holds(&self, sample: &WearerSample) -> bool {
        self.generation == sample.origin
    }

    /// The wearer's size over the avatar's.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// A standing wearer who is taller than thought, `seconds` after the last time.
    pub(super) fn stretch(&mut self, eye_height: f64, avatar_eye_height: f64, seconds: f64) {
        let scale = scale_of(eye_height, avatar_eye_height);
        if scale > self.scale {
            self.scale += (scale - self.scale) * (1.0 - (-seconds / STRETCH_SECONDS).exp());
        }
    }

    /// A point in the avatar's metres.
    pub(super) fn point(&self, floor: DVec3) -> DVec3 {
        self.turn * (floor - self.origin) / self.scale
    }

    /// The wearer's metres again: floor space of a point of motion space.
    pub(super) fn floor(&self, motion: DVec3) -> DVec3 {
        self.turn.inverse() * (motion * self.scale) + self.origin
    }

    /// A turn against floor space as one against motion space.
    pub(super) fn turn(&self, floor: DQuat) -> DQuat {
        self.turn * floor
    }

    /// A thing of `OpenXR`, in its own axes.
    pub(super) fn pose(&self, floor_from_thing: &Affine3A) -> Pose {
        let thing = pose(floor_from_thing);
        Pose {
            rotation: self.turn * thing.rotation,
            position: self.point(thing.position),
        }
    }

    /// The avatar's head whose eyes are the view's: its axes, and the middle between its eyes.
    pub(super) fn head(&self, floor_from_view: &Affine3A) -> Pose {
        let view = self.pose(floor_from_view);
        Pose {
            rotation: view.rotation * half_turn(),
            ..view
        }
    }
}

/// The wearer's size over the avatar's by the heights of their eyes when both stand upright, within what people differ by.
pub(super) fn scale_of(eye_height: f64, avatar_eye_height: f64) -> f64 {
    let scale = eye_height / avatar_eye_height.max(0.1);
    if scale.is_finite() {
        scale.clamp(SCALES[0], SCALES[1])
    } else {
        1.0
    }
}

/// Where a head is turned about y, radians from +z; also where it looks straight down or up.
pub(super) fn heading(head: DQuat) -> f64 {
    let (looks, up) = (head * DVec3::Z, head * DVec3::Y);
    let flat = looks - up * looks.y;
    if flat.x.hypot(flat.z) < 1e-6 {
        return 0.0;
    }
    flat.x.atan2(flat.z)
}

fn pose(affine: &Affine3A) -> Pose {
    let (_, rotation, position) = affine.to_scale_rotation_translation();
    Pose {
        rotation: rotation.as_dquat().normalize(),
        position: position.as_dvec3(),
    }
}
