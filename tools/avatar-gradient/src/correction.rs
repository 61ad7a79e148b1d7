//! What a frame's pose lacks, as it is learnt with everything else.

use glam::Vec3;
use spmm3::{Joint, MotionParams, PARAMS};
use std::f32::consts::TAU;

/// Numbers of one frame's correction: those of P, then a shift of the root.
pub const CORRECTION: usize = PARAMS + 3;

/// A correction of one frame's pose, or the derivatives of a loss by it: 215 numbers that are added to P (axis-angle vectors in radians,
/// expression coefficients; in P's order), then three that are added to the root translation, metres.
///
/// Corrections are small, so that axis-angle vectors are added, not multiplied. What should not be corrected (the expression of a person
/// whose face is not seen) gets no step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseCorrection(pub [f32; CORRECTION]);

impl Default for PoseCorrection {
    /// None.
    fn default() -> Self {
        Self([0.0; CORRECTION])
    }
}

impl PoseCorrection {
    /// What makes `to` of `from`. An axis-angle vector and one that is a whole turn longer or shorter are the same rotation: the nearest one counts.
    /// The face, whose coefficients are nobody's to correct, has none.
    #[must_use]
    pub fn between(from: &MotionParams, to: &MotionParams) -> Self {
        let mut correction = Self::default();
        for joint in Joint::ALL {
            let (before, after) = (from.axis_angle(joint), to.axis_angle(joint));
            let angle = after.length();
            let turns = [-1.0, 1.0].map(|turn| {
                let longer = (angle + turn * TAU) / angle.max(f32::MIN_POSITIVE);
                after * longer - before
            });
            let nearest = (turns.into_iter().filter(|change| change.is_finite())).fold(
                after - before,
                |best, change| {
                    if change.length() < best.length() {
                        change
                    } else {
                        best
                    }
                },
            );
            let at = MotionParams::offset_of(joint);
            correction.0[at..at + 3].copy_from_slice(&nearest.to_array());
        }
        let shift = to.root_translation - from.root_translation;
        correction.0[PARAMS..].copy_from_slice(&shift.to_array());
        correction
    }

    /// The part for P.
    #[must_use]
    pub fn parameters(&self) -> &[f32] {
        &self.0[..PARAMS]
    }

    /// The part for the root translation, metres.
    #[must_use]
    pub fn shift(&self) -> Vec3 {
        Vec3::from_slice(&self.0[PARAMS..])
    }

    /// `motion` as corrected: what an avatar's networks and skeleton are given.
    #[must_use]
    pub fn applied(&self, motion: &MotionParams) -> MotionParams {
        let mut corrected = motion.clone();
        for (value, more) in corrected.values_mut().iter_mut().zip(self.parameters()) {
            *value += more;
        }
        corrected.root_translation += self.shift();
        corrected
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_just_over_half_a_turn_is_near_one_just_under_it() {
        let of = |angle: f32| {
            let mut motion = MotionParams::default();
            motion.values_mut()[MotionParams::offset_of(Joint::Pelvis) + 1] = angle;
            motion.root_translation.z = angle;
            motion
        };
        let at = MotionParams::offset_of(Joint::Pelvis) + 1;
        let between = PoseCorrection::between(&of(3.1), &of(3.2 - TAU));
        assert!((between.0[at] - 0.1).abs() < 1e-5, "{}", between.0[at]);
        let between = PoseCorrection::between(&of(-0.2), &of(0.0));
        assert!((between.0[at] - 0.2).abs() < 1e-6, "to none");
        assert!((between.shift().z - 0.2).abs() < 1e-6, "the root");
    }
}
