//! The viewer: head and hands as a tracker gives them, which may be missing or absurd.

use glam::{Affine3A, Vec2, Vec3, Vec3Swizzles};
use renderer_openxr::input::Hand;

/// Trackers do not reach further, metres.
const FURTHEST: f32 = 1_000.0;

/// Below this sine a direction is too steep to say where it points horizontally.
const STEEP: f32 = 0.1;

/// The viewer in one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Viewer {
    /// The head, which looks along -z, if it is tracked. Rigid.
    pub floor_from_head: Option<Affine3A>,
    /// The left hand and the right.
    pub hands: [Hand; 2],
}

/// Where the viewer stands and which way they look, seen from above: x and z of floor space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    /// Metres.
    pub(super) floor: Vec2,
    /// A unit vector.
    pub(super) ahead: Vec2,
}

impl Viewer {
    /// From above; nothing without a head.
    pub(super) fn view(&self) -> Option<View> {
        let head = trusted(self.floor_from_head)?;
        Some(View {
            floor: head.translation.xz(),
            ahead: level(
                -head.matrix3.z_axis.to_vec3(),
                head.matrix3.y_axis.to_vec3(),
            ),
        })
    }
}

/// A tracked pose that can be one: finite, not out of this world, neither stretched nor flattened.
pub(super) fn trusted(pose: Option<Affine3A>) -> Option<Affine3A> {
    pose.filter(|pose| {
        let axes = pose.matrix3;
        pose.is_finite()
            && pose.translation.abs().max_element() <= FURTHEST
            && [axes.x_axis, axes.y_axis, axes.z_axis]
                .iter()
                .all(|axis| (0.9..1.1).contains(&axis.length()))
    })
}

/// Which way a person faces, seen from above, as a unit vector (x, z). Who looks straight down has the crown of the head
/// before them, who looks straight up has it behind.
pub(super) fn level(forward: Vec3, up: Vec3) -> Vec2 {
    let ahead = if forward.xz().length() >= STEEP {
        forward
    } else {
        up * -forward.y.signum()
    };
    ahead.xz().normalize_or(Vec2::NEG_Y)
}
