//! How far a person's joints turn: boxes on the rotation vectors of the joints relative to their parents.

use super::chain::BODY_JOINTS;
use nalgebra::Vector3;

/// Information of a joint beyond its range, 1 / square radians.
const FIRM: f64 = 400.0;

/// Lowest and highest rotation vector of each joint, radians; left joints, whose right twins are mirrored. After the ranges of
/// the American Academy of Orthopaedic Surgeons, widened where SMPL-X's axes are not the joint's own.
const RANGES: [(usize, [f64; 3], [f64; 3]); 13] = [
    (1, [-2.4, -1.0, -0.9], [0.8, 1.0, 1.0]),
    (3, [-0.6, -0.5, -0.5], [1.2, 0.5, 0.5]),
    (4, [-0.05, -0.3, -0.3], [2.6, 0.3, 0.3]),
    (6, [-0.5, -0.5, -0.5], [0.8, 0.5, 0.5]),
    (7, [-0.9, -0.6, -0.6], [0.8, 0.6, 0.6]),
    (9, [-0.5, -0.5, -0.5], [0.6, 0.5, 0.5]),
    (10, [-1.0, -0.2, -0.3], [0.6, 0.2, 0.3]),
    (12, [-0.8, -0.9, -0.6], [0.8, 0.9, 0.6]),
    (13, [-0.5, -0.5, -0.5], [0.5, 0.5, 0.7]),
    (15, [-0.7, -0.9, -0.6], [0.7, 0.9, 0.6]),
    (16, [-1.9, -2.2, -2.0], [1.9, 1.5, 1.7]),
    (18, [-1.5, -2.7, -0.6], [1.5, 0.1, 0.6]),
    (20, [-1.2, -1.0, -1.4], [1.2, 1.0, 1.4]),
];

/// The ranges of all joints; the pelvis has none.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Limits {
    low: [Vector3<f64>; BODY_JOINTS],
    high: [Vector3<f64>; BODY_JOINTS],
}

impl Default for Limits {
    fn default() -> Self {
        let mut limits = Self {
            low: [Vector3::repeat(-10.0); BODY_JOINTS],
            high: [Vector3::repeat(10.0); BODY_JOINTS],
        };
        for (joint, low, high) in RANGES {
            limits.low[joint] = low.into();
            limits.high[joint] = high.into();
            let single = matches!(joint, 3 | 6 | 9 | 12 | 15);
            if !single {
                // In a mirror, turns about y and z change their sense.
                limits.low[joint + 1] = Vector3::new(low[0], -high[1], -high[2]);
                limits.high[joint + 1] = Vector3::new(high[0], -low[1], -low[2]);
            }
        }
        limits
    }
}

impl Limits {
    /// By how much a rotation vector is out of its joint's range, radians, and the information of each axis: zero within.
    pub(super) fn excess(&self, joint: usize, log: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let over = log - log.sup(&self.low[joint]).inf(&self.high[joint]);
        (over, over.map(|v| if v == 0.0 { 0.0 } else { FIRM }))
    }
}
