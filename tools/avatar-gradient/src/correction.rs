//! What a frame's pose lacks, as it is learnt with everything else.

use glam::Vec3;
use spmm3::{MotionParams, PARAMS};

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
