//! Real spherical harmonics up to degree 3, as 3DGS evaluates colour (`computeColorFromSH` of its rasteriser), and how
//! their coefficients turn when the scene is turned.

use glam::{DMat3, DQuat, DVec3, Quat};

/// The constant basis function of degree 0.
pub const SH_C0: f32 = 0.282_094_79;

/// The highest degree of spherical harmonics that scenes have.
pub const MAX_SH_DEGREE: u8 = 3;

/// Coefficients above degree 0 that a function of `sh_degree` has: 0, 3, 8 or 15; more than degree 3 counts as 3.
pub const fn rest_coefficients(sh_degree: u8) -> usize {
    match sh_degree {
        0 => 0,
        1 => 3,
        2 => 8,
        _ => 15,
    }
}

/// The 16 basis functions of degree 0 to 3 at a unit direction (from the eye to the Gaussian), in 3DGS' order and signs:
/// orthonormal over the sphere. A Gaussian's colour is `0.5 + sum(coefficient * basis)`, cut at zero.
pub fn sh_basis(direction: [f64; 3]) -> [f64; 16] {
    const C0: f64 = 0.282_094_791_773_878_14;
    const C1: f64 = 0.488_602_511_902_919_9;
    const C2: [f64; 3] = [
        1.092_548_430_592_079_2,
        0.315_391_565_252_520_05,
        0.546_274_215_296_039_6,
    ];
    const C3: [f64; 5] = [
        0.590_043_589_926_643_5,
        2.890_611_442_640_554,
        0.457_045_799_464_465_8,
        0.373_176_332_590_115_4,
        1.445_305_721_320_277,
    ];
    let [x, y, z] = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        C0,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * x * y,
        -C2[0] * y * z,
        C2[1] * (2.0 * zz - xx - yy),
        -C2[0] * x * z,
        C2[2] * (xx - yy),
        -C3[0] * y * (3.0 * xx - yy),
        C3[1] * x * y * z,
        -C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3[2] * x * (4.0 * zz - xx - yy),
        C3[4] * z * (xx - yy),
        -C3[0] * x * (xx - 3.0 * yy),
    ]
}

/// How SH coefficients above degree 0 turn with a scene: one matrix for each degree, since a rotation mixes only functions
/// of one degree.
#[derive(Debug, Clone, PartialEq)]
pub struct ShRotation {
    degree1: [[f32; 3]; 3],
    degree2: [[f32; 5]; 5],
    degree3: [[f32; 7]; 7],
}

impl ShRotation {
    /// The matrices for a unit quaternion `to_from`, so that the turned function at direction d is the function before at
    /// `to_from^-1 d`.
    pub fn new(to_from: Quat) -> Self {
        // An entry is the integral over the sphere of Y_i(d) Y_j(to_from^-1 d), a polynomial of degree 6 at most:
        // Gauss-Legendre in z with 4 nodes times 7 equal steps around is exact for it.
        const NODES: [(f64, f64); 4] = [
            (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
            (-0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
            (0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
            (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        ];
        const AROUND: u8 = 7;
        let rotation: DQuat = to_from.as_dquat().normalize();
        let from_to = DMat3::from_quat(rotation.inverse());
        let mut sums = [[0.0_f64; 16]; 16];
        for (z, weight) in NODES {
            let radius = (1.0 - z * z).sqrt();
            for step in 0..AROUND {
                let angle = std::f64::consts::TAU * f64::from(step) / f64::from(AROUND);
                let to = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
                let after = sh_basis(to.to_array());
                let before = sh_basis((from_to * to).to_array());
                let area = weight * std::f64::consts::TAU / f64::from(AROUND);
                for (row, &a) in sums.iter_mut().zip(&after) {
                    for (sum, &b) in row.iter_mut().zip(&before) {
                        *sum += area * a * b;
                    }
                }
            }
        }
        Self {
            degree1: block(&sums, 1),
            degree2: block(&sums, 4),
            degree3: block(&sums, 9),
        }
    }

    /// Turns one Gaussian's coefficients above degree 0, `[3, 8 or 15][rgb]`; a degree that is not whole is left as it is.
    pub fn apply(&self, sh_rest: &mut [f32]) {
        let (first, rest) = sh_rest.split_at_mut(sh_rest.len().min(9));
        let (second, third) = rest.split_at_mut(rest.len().min(15));
        multiply(&self.degree1, first);
        multiply(&self.degree2, second);
        multiply(&self.degree3, third);
    }
}

fn block<const N: usize>(sums: &[[f64; 16]; 16], start: usize) -> [[f32; N]; N] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "an entry between -1 and 1 rounded to f32"
    )]
    std::array::from_fn(|row| {
        std::array::from_fn(|column| sums[start + row][start + column] as f32)
    })
}

fn multiply<const N: usize>(matrix: &[[f32; N]; N], values: &mut [f32]) {
    if values.len() != 3 * N {
        return;
    }
    let mut turned = [[0.0_f32; 3]; N];
    for (out, row) in turned.iter_mut().zip(matrix) {
        for (entry, before) in row.iter().zip(values.chunks_exact(3)) {
            for (sum, value) in out.iter_mut().zip(before) {
                *sum += entry * value;
            }
        }
    }
    values.copy_from_slice(turned.as_flattened());
}
