//! Presence against its own promises: whatever heads, hands and people do.

mod hands;
mod places;
mod seat;
mod shadow;

use super::{Presence, Standing, Viewer, first_apart};
use glam::{Affine3A, Quat, Vec2, Vec3, Vec3Swizzles};
use renderer_openxr::input::Hand;
use spmm3::{Joint, MotionParams, Skeleton, at_ease};
use std::sync::OnceLock;
use std::time::Duration;
use synthetic_person::{Puppet, PuppetSize};

/// A display at 90 Hz.
const FRAME: Duration = Duration::from_micros(11_111);

fn skeleton() -> &'static Skeleton {
    static SKELETON: OnceLock<Skeleton> = OnceLock::new();
    SKELETON.get_or_init(|| Puppet::new(PuppetSize::SMALL).skeleton)
}

/// A person at ease, somewhere in their own motion space.
fn standing_at(heading: f32, at: Vec2) -> Standing {
    Standing::of(skeleton(), &motion(heading, at)).expect("a pose that can be")
}

fn motion(heading: f32, at: Vec2) -> MotionParams {
    let mut motion = at_ease(skeleton());
    motion.set_rotation(Joint::Pelvis, Quat::from_rotation_y(heading));
    motion.root_translation += Vec3::new(at.x, 0.0, at.y);
    motion
}

/// A head or a hand: turned to the left by `yaw`, then up by `pitch`, radians.
fn pose(at: Vec3, yaw: f32, pitch: f32) -> Affine3A {
    let turn = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch);
    Affine3A::from_rotation_translation(turn, at)
}

/// A viewer whose hands rest.
fn viewer(at: Vec3, yaw: f32, pitch: f32) -> Viewer {
    Viewer {
        floor_from_head: Some(pose(at, yaw, pitch)),
        ..Viewer::default()
    }
}

/// Where a person stands in the room, and the direction they face, as (x, z).
fn seen(floor_from_person: &Affine3A, standing: &Standing) -> (Vec2, Vec2) {
    let at = floor_from_person.transform_point3(standing.joint(Joint::Pelvis));
    let (sin, cos) = standing.heading.sin_cos();
    let faces = floor_from_person.transform_vector3(Vec3::new(sin, 0.0, cos));
    (at.xz(), faces.xz())
}
