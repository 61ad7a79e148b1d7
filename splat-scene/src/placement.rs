//! Places a scene, which has its own units and origin, in the viewer's space.

use glam::{Quat, Vec3};

use crate::{MAX_COORDINATE, MAX_LOG_SCALE, Scene, SceneError, ShRotation};

/// A uniform scale, then a rotation, then a translation: `to = rotation * (scale * from) + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    scale: f32,
    rotation: Quat,
    translation: Vec3,
}

impl Placement {
    /// A checked placement; `translation` in the units after scaling.
    ///
    /// # Errors
    /// [`SceneError::Placement`] for a scale outside 1e-6 to 1e6, a quaternion that is not of unit length (within 1e-3), or
    /// a translation that is not finite or beyond [`MAX_COORDINATE`].
    pub fn new(scale: f32, rotation: Quat, translation: Vec3) -> Result<Self, SceneError> {
        let wrong = |what: String, advice| Err(SceneError::Placement { what, advice });
        if !(1e-6..=1e6).contains(&scale) {
            return wrong(
                format!("the scale {scale}"),
                "give one from 0.000001 to 1000000",
            );
        }
        if !(0.999..=1.001).contains(&rotation.length()) {
            return wrong(format!("the quaternion {rotation}"), "give one of length 1");
        }
        let reach = -MAX_COORDINATE..=MAX_COORDINATE;
        if !translation.to_array().iter().all(|v| reach.contains(v)) {
            return wrong(
                format!("the translation {translation}"),
                "give finite numbers of at most 1000000000",
            );
        }
        Ok(Self {
            scale,
            rotation: rotation.normalize(),
            translation,
        })
    }
}

impl Scene {
    /// Moves the whole scene, its spherical harmonics too: seen from a camera that is moved alike, it looks as before.
    pub fn place(&mut self, to_from: &Placement) {
        let Placement {
            scale,
            rotation,
            translation,
        } = *to_from;
        let rest_values = 3 * self.rest_coefficients();
        let log_scale = scale.ln();
        let arrays = &mut self.arrays;
        for position in &mut arrays.positions {
            let moved = rotation * (Vec3::from_array(*position) * scale) + translation;
            *position = moved
                .clamp(Vec3::splat(-MAX_COORDINATE), Vec3::splat(MAX_COORDINATE))
                .to_array();
        }
        for value in arrays.log_scales.as_flattened_mut() {
            *value = (*value + log_scale).clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE);
        }
        if rotation == Quat::IDENTITY {
            return;
        }
        for own in &mut arrays.rotations {
            *own = (rotation * Quat::from_array(*own)).normalize().to_array();
        }
        if rest_values > 0 {
            let turn = ShRotation::new(rotation);
            for rest in arrays.sh_rest.chunks_exact_mut(rest_values) {
                turn.apply(rest);
            }
        }
    }
}
