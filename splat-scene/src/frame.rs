//! From a file's axes to OpenXR's (x right, y up, z back). Most files are in COLMAP's (x right, y down, z forward): a turn
//! by 180 degrees about x, which is its own inverse, done as each Gaussian is read. Other axes are turned as a whole.

use glam::{Quat, Vec3};

use crate::axes::Axes;
use crate::{Scene, ShRotation, Splat};

/// The signs of the SH coefficients above degree 0 under y -> -y, z -> -z: each basis function of [`crate::sh_basis`] is a
/// polynomial that is even or odd in that change.
const REST_SIGNS: [f32; 15] = [
    -1.0, -1.0, 1.0, // y, z, x
    -1.0, 1.0, 1.0, -1.0, 1.0, // xy, yz, 2zz-xx-yy, xz, xx-yy
    -1.0, 1.0, -1.0, -1.0, 1.0, -1.0,
    1.0, // y(3xx-yy), xyz, y(4zz-..), z(..), x(4zz-..), z(xx-yy), x(xx-3yy)
];

/// Turns a Gaussian by 180 degrees about x.
pub(crate) fn turn(splat: &mut Splat, sh_rest: &mut [f32]) {
    splat.position = turned_vector(splat.position);
    splat.rotation = turned_rotation(splat.rotation);
    for (coefficient, sign) in sh_rest.chunks_exact_mut(3).zip(REST_SIGNS) {
        for value in coefficient {
            *value *= sign;
        }
    }
}

/// A vector or point turned by 180 degrees about x.
pub(crate) fn turned_vector([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// The rotation `F R F`, with F the turn: R between frames that are both turned. For a Gaussian it gives the covariance of
/// `F R`, as its own axes' signs do not matter.
pub(crate) fn turned_rotation([x, y, z, w]: [f32; 4]) -> [f32; 4] {
    [x, -y, -z, w]
}

impl Scene {
    /// Turns all Gaussians, which lie in `axes`, into OpenXR's.
    pub(crate) fn turn_from(&mut self, axes: Axes) {
        if axes == Axes::HOUSE {
            return;
        }
        let rest_values = 3 * self.rest_coefficients();
        let rotation = axes.rotation();
        let arrays = &mut self.arrays;
        for position in &mut arrays.positions {
            *position = axes.house(Vec3::from_array(*position)).to_array();
        }
        // A point reflection leaves a Gaussian's shape as it is.
        for own in &mut arrays.rotations {
            *own = (rotation * Quat::from_array(*own)).normalize().to_array();
        }
        if rest_values == 0 {
            return;
        }
        let turn = ShRotation::new(rotation);
        for rest in arrays.sh_rest.chunks_exact_mut(rest_values) {
            turn.apply(rest);
            if axes.mirrored() {
                // Functions of odd degree change their sign: three values for each of 3 and of 7 coefficients.
                for (index, value) in rest.iter_mut().enumerate() {
                    if !(9..24).contains(&index) {
                        *value = -*value;
                    }
                }
            }
        }
    }
}
