//! What a person's pose is like before anything is seen: a Gaussian over the joints' rotation vectors.
//!
//! Its covariance is a wide one set by hand, so that no possible pose is far away, and the principal components of recorded motion on top
//! (`examples/learn_prior.rs`): how arms swing against legs, and how a bend of the back is shared out.

use super::{
    chain::{BODY_JOINTS, Posture},
    prior_table::{COMPONENTS, MEAN},
    so3,
};
use nalgebra::{DMatrix, Matrix3, Vector3};

const VALUES: usize = 3 * BODY_JOINTS;

/// Standard deviations about each joint's axes beside the recorded components, radians, and the joints they are for. Flexion of
/// the knee is about x; of the elbow about y, and its x is the forearm's twist.
const BASE: [(&[usize], [f64; 3]); 11] = [
    (&[1, 2], [0.7, 0.26, 0.35]),
    (&[3, 6, 9], [0.1, 0.08, 0.07]),
    (&[4, 5], [0.9, 0.06, 0.08]),
    (&[7, 8], [0.35, 0.2, 0.2]),
    (&[10, 11], [0.15, 0.03, 0.05]),
    (&[12], [0.25, 0.3, 0.2]),
    (&[13, 14], [0.12, 0.12, 0.15]),
    (&[15], [0.25, 0.3, 0.2]),
    (&[16, 17], [0.7, 0.8, 0.8]),
    (&[18, 19], [0.4, 1.0, 0.12]),
    (&[20, 21], [0.35, 0.35, 0.35]),
];

/// How much of the recordings' mean a joint's mean is: their spines bend forward, as one who boxes does.
fn mean_share(joint: usize) -> f64 {
    if matches!(joint, 3 | 6 | 9) {
        0.25
    } else {
        1.0
    }
}

/// A Gaussian over the rotation vectors of all body joints but the pelvis.
#[derive(Debug, Clone, PartialEq)]
pub struct PosePrior {
    mean: [Vector3<f64>; BODY_JOINTS],
    /// The inverse of the covariance in blocks of joints by joints.
    information: Vec<[Matrix3<f64>; BODY_JOINTS]>,
}

impl Default for PosePrior {
    fn default() -> Self {
        let mut covariance = DMatrix::<f64>::identity(VALUES, VALUES);
        for (joints, deviations) in BASE {
            for joint in joints {
                for (axis, deviation) in deviations.into_iter().enumerate() {
                    let at = 3 * joint + axis;
                    covariance[(at, at)] = deviation * deviation;
                }
            }
        }
        for component in &COMPONENTS {
            for (row, a) in component.iter().enumerate() {
                for (column, b) in component.iter().enumerate() {
                    covariance[(row, column)] += a * b;
                }
            }
        }
        // A diagonal above zero and a sum of squares are positive definite.
        let inverse = covariance
            .cholesky()
            .map_or_else(|| DMatrix::identity(VALUES, VALUES), |c| c.inverse());
        Self {
            mean: std::array::from_fn(|joint| {
                Vector3::from_column_slice(&MEAN[3 * joint..3 * joint + 3]) * mean_share(joint)
            }),
            information: (0..BODY_JOINTS)
                .map(|row| {
                    std::array::from_fn(|column| {
                        inverse.fixed_view::<3, 3>(3 * row, 3 * column).into_owned()
                    })
                })
                .collect(),
        }
    }
}

impl PosePrior {
    /// The most likely pose, upright at the world's origin.
    #[must_use]
    pub fn posture(&self) -> Posture {
        Posture {
            rotations: std::array::from_fn(|joint| so3::exp(&self.mean[joint])),
            ..Posture::default()
        }
    }

    /// The most likely rotation vector of a joint, radians; arms hang.
    pub(super) fn mean(&self, joint: usize) -> Vector3<f64> {
        self.mean[joint]
    }

    /// The information between two joints, 1 / square radians.
    pub(super) fn information(&self, row: usize, column: usize) -> Matrix3<f64> {
        self.information[row][column]
    }
}
