//! Where panels hang: upright before the viewer, turned to them.

use crate::overlay::Panel;
use glam::{Affine3A, Mat3A, Vec3};
use renderer_openxr::panel::PanelImage;

/// A place before the viewer, in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    away: f32,
    below_eyes: f32,
    to_the_right: f32,
}

impl Spot {
    /// Clear of the person that the viewer looks at.
    pub(super) const BESIDE: Self = Self {
        away: 0.8,
        below_eyes: 0.12,
        to_the_right: 0.32,
    };
    /// Where they look.
    pub(super) const AHEAD: Self = Self {
        away: 1.1,
        below_eyes: 0.1,
        to_the_right: 0.0,
    };

    /// Before a head.
    pub(super) fn before(self, floor_from_head: Affine3A) -> Affine3A {
        let head = Vec3::from(floor_from_head.translation);
        let ahead = floor_from_head.transform_vector3(Vec3::NEG_Z);
        let ahead = Vec3::new(ahead.x, 0.0, ahead.z).normalize_or(Vec3::NEG_Z);
        let right = ahead.cross(Vec3::Y);
        let at = head + ahead * self.away + right * self.to_the_right - Vec3::Y * self.below_eyes;
        let back = (head - at).normalize_or(-ahead);
        let side = Vec3::Y.cross(back).normalize_or(right);
        Affine3A {
            matrix3: Mat3A::from_cols(side.into(), back.cross(side).into(), back.into()),
            translation: at.into(),
        }
    }
}

/// A panel as the headset takes it.
pub(super) fn image(panel: &Panel) -> PanelImage<'_> {
    PanelImage {
        width: panel.width,
        height: panel.height,
        rgba: &panel.pixels,
    }
}
