//! The person's arithmetic in f64, written from the formulas, independently of `spmm3`: it reads that crate's data and calls
//! none of its functions that compute.
//!
//! Rotations are matrices throughout (Rodrigues' formula, no quaternion products), so that a mistake in either form of
//! them shows.

use spmm3::networks::{AttributeNetwork, Dense, MeshNetwork, QuantisedBases};
use spmm3::{BoundGaussians, Controllers, Template};

/// A vector.
pub type V3 = [f64; 3];
/// A matrix as rows.
pub type M3 = [V3; 3];

/// SMPL-X's `kintree_table`, the pelvis being its own root.
pub const PARENTS: [usize; 55] = [
    0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15, 20, 25,
    26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20, 37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49,
    50, 21, 52, 53,
];

/// A rigid motion: x -> `rotation` x + `translation`.
#[derive(Debug, Clone, Copy)]
pub struct Rigid {
    /// Rotation matrix.
    pub rotation: M3,
    /// Translation in metres.
    pub translation: V3,
}

impl Rigid {
    /// Maps a point.
    #[must_use]
    pub fn apply(&self, x: V3) -> V3 {
        add(mul_v(self.rotation, x), self.translation)
    }
}

/// `v` in f64.
#[must_use]
pub fn wide(v: glam::Vec3) -> V3 {
    [v.x, v.y, v.z].map(f64::from)
}

/// Sum.
#[must_use]
pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Difference.
#[must_use]
pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a` times a number.
#[must_use]
pub fn scale(a: V3, k: f64) -> V3 {
    a.map(|x| x * k)
}

/// Scalar product.
#[must_use]
pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[must_use]
pub fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Length.
#[must_use]
pub fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Matrix times vector.
#[must_use]
pub fn mul_v(m: M3, x: V3) -> V3 {
    m.map(|row| dot(row, x))
}

/// Transposed matrix.
#[must_use]
pub fn transpose(m: M3) -> M3 {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Matrix product.
#[must_use]
pub fn mul(a: M3, b: M3) -> M3 {
    let columns = transpose(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

/// Rodrigues' formula: the rotation by |v| radians about v.
#[must_use]
pub fn rodrigues(v: V3) -> M3 {
    let angle = norm(v);
    let (first, second) = if angle < 1e-8 {
        (1.0, 0.5)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle))
    };
    let skew = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]];
    let square = mul(skew, skew);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            f64::from(u8::from(i == j)) + first * skew[i][j] + second * square[i][j]
        })
    })
}

/// The matrix of a quaternion x, y, z, w of any length but 0.
#[must_use]
pub fn quaternion_matrix(q: [f64; 4]) -> M3 {
    let [x, y, z, w] = q;
    let s = 2.0 / (x * x + y * y + z * z + w * w);
    [
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - z * w),
            s * (x * z + y * w),
        ],
        [
            s * (x * y + z * w),
            1.0 - s * (x * x + z * z),
            s * (y * z - x * w),
        ],
        [
            s * (x * z - y * w),
            s * (y * z + x * w),
            1.0 - s * (x * x + y * y),
        ],
    ]
}

/// Axis-angle of joint `j` among 215 motion values: body 75, then 50 expression values, then hands.
fn axis_angle(motion: &[f32], j: usize) -> V3 {
    let at = if j < 25 {
        3 * j
    } else {
        75 + 50 + 3 * (j - 25)
    };
    [0, 1, 2].map(|k| f64::from(motion[at + k]))
}

/// Forward kinematics (SMPL, equation 3): each joint's frame in the person's space, root translation left out.
#[must_use]
pub fn forward_kinematics(rest: &[glam::Vec3; 55], motion: &[f32]) -> Vec<Rigid> {
    let mut joints: Vec<Rigid> = Vec::with_capacity(55);
    for (j, parent) in PARENTS.into_iter().enumerate() {
        let rotation = rodrigues(axis_angle(motion, j));
        joints.push(if j == 0 {
            Rigid {
                rotation,
                translation: wide(rest[0]),
            }
        } else {
            let above = joints[parent];
            Rigid {
                rotation: mul(above.rotation, rotation),
                translation: above.apply(sub(wide(rest[j]), wide(rest[parent]))),
            }
        });
    }
    joints
}

/// Each joint's motion from rest to pose: `x -> R (x - rest) + position`.
#[must_use]
pub fn posed_from_rest(rest: &[glam::Vec3; 55], joints: &[Rigid]) -> Vec<Rigid> {
    joints
        .iter()
        .zip(rest)
        .map(|(joint, rest)| Rigid {
            rotation: joint.rotation,
            translation: sub(joint.translation, mul_v(joint.rotation, wide(*rest))),
        })
        .collect()
}

/// Linear blend skinning of `shape` (canonical vertices, metres) with the template's weights.
#[must_use]
pub fn skin(template: &Template, shape: &[V3], posed_from_rest: &[Rigid]) -> Vec<V3> {
    template
        .skin()
        .iter()
        .zip(shape)
        .map(|(skin, x)| {
            let mut sum = [0.0; 3];
            for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                let moved = posed_from_rest[usize::from(*joint)].apply(*x);
                sum = add(sum, scale(moved, f64::from(weight)));
            }
            sum
        })
        .collect()
}

fn layer(x: &[f64], layer: &Dense) -> Vec<f64> {
    (0..layer.outputs())
        .map(|o| {
            let products = x
                .iter()
                .enumerate()
                .map(|(i, x)| x * f64::from(layer.weights()[i * layer.outputs() + o].to_f32()));
            f64::from(layer.bias()[o]) + products.sum::<f64>()
        })
        .collect()
}

fn silu(x: Vec<f64>) -> Vec<f64> {
    x.into_iter().map(|x| x / (1.0 + (-x).exp())).collect()
}

/// F_mesh: canonical offset of every vertex, metres.
#[must_use]
pub fn mesh_offsets(network: &MeshNetwork, motion: &[f32]) -> Vec<V3> {
    let p: Vec<f64> = motion.iter().map(|x| f64::from(*x)).collect();
    let hidden = silu(layer(&p, &network.first));
    let hidden = silu(layer(&hidden, &network.second));
    let code = layer(&hidden, &network.code);
    let decoder = &network.decoder;
    let columns = decoder.mean().len();
    let unit = f64::from(decoder.unit());
    let flat: Vec<f64> = (0..columns)
        .map(|c| {
            let field: f64 = code
                .iter()
                .enumerate()
                .map(|(r, k)| k * f64::from(decoder.values()[r * columns + c]))
                .sum();
            f64::from(decoder.mean()[c]) + field * unit * f64::from(decoder.scales()[c].to_f32())
        })
        .collect();
    let count = columns / 3;
    (0..count)
        .map(|v| [flat[v], flat[count + v], flat[2 * count + v]])
        .collect()
}

/// The posed mesh: LBS(V_template + F_mesh(P)), root translation left out.
#[must_use]
pub fn posed_mesh(
    template: &Template,
    rest: &[glam::Vec3; 55],
    network: &MeshNetwork,
    motion: &[f32],
) -> Vec<V3> {
    let offsets = mesh_offsets(network, motion);
    let shape: Vec<V3> = template
        .vertices()
        .iter()
        .zip(offsets)
        .map(|(v, offset)| add(wide(*v), offset))
        .collect();
    let joints = forward_kinematics(rest, motion);
    skin(template, &shape, &posed_from_rest(rest, &joints))
}

/// Displacement potentials u_j of every controller, `[C][B]`.
#[must_use]
pub fn potentials(network: &AttributeNetwork, controllers: usize, motion: &[f32]) -> Vec<Vec<f64>> {
    let p: Vec<f64> = motion.iter().map(|x| f64::from(*x)).collect();
    let units = silu(layer(&p, &network.first));
    let hidden = units.len() / controllers;
    let bases = network.second_bias.len() / controllers;
    (0..controllers)
        .map(|c| {
            (0..bases)
                .map(|b| {
                    let products = (0..hidden).map(|h| {
                        let weight = network.second[(c * hidden + h) * bases + b].to_f32();
                        units[c * hidden + h] * f64::from(weight)
                    });
                    f64::from(network.second_bias[c * bases + b]) + products.sum::<f64>()
                })
                .collect()
        })
        .collect()
}

/// F_attr: residuals of every Gaussian, `[N_g][14]`.
#[must_use]
pub fn residuals(
    network: &AttributeNetwork,
    controllers: &Controllers,
    motion: &[f32],
) -> Vec<[f64; 14]> {
    let potentials = potentials(network, controllers.vertices().len(), motion);
    residuals_of(&network.bases, controllers, &potentials)
}

/// F_attr's second half: residuals of every Gaussian, `[N_g][14]`, by given potentials `[C][B]`.
#[must_use]
pub fn residuals_of(
    bases: &QuantisedBases,
    controllers: &Controllers,
    potentials: &[Vec<f64>],
) -> Vec<[f64; 14]> {
    let (b_count, count) = (
        bases.values().len() / bases.scales().len(),
        controllers.masses().len(),
    );
    (0..count)
        .map(|i| {
            let force: Vec<f64> = (0..b_count)
                .map(|b| {
                    (0..3)
                        .map(|k| {
                            let controller = usize::from(controllers.neighbours()[i][k]);
                            f64::from(controllers.masses()[i][k]) * potentials[controller][b]
                        })
                        .sum()
                })
                .collect();
            std::array::from_fn(|plane| {
                let step = f64::from(bases.units()[plane])
                    * f64::from(bases.scales()[plane * count + i].to_f32());
                force
                    .iter()
                    .enumerate()
                    .map(|(b, f)| {
                        f * step * f64::from(bases.values()[(plane * b_count + b) * count + i])
                    })
                    .sum()
            })
        })
        .collect()
}

/// One posed Gaussian.
#[derive(Debug, Clone, Copy)]
pub struct ReferenceGaussian {
    /// Centre, metres.
    pub position: V3,
    /// Principal axes as columns.
    pub rotation: M3,
    /// Natural logarithms of the standard deviations, metres.
    pub log_scale: V3,
    /// Opacity before the sigmoid.
    pub opacity_logit: f64,
    /// Colour coefficients.
    pub colour: V3,
}

/// F_m2g with residuals: Gaussians on a posed mesh, moved by the root translation.
#[must_use]
pub fn gaussians_on_mesh(
    template: &Template,
    bound: &BoundGaussians,
    posed: &[V3],
    residuals: Option<&[[f64; 14]]>,
    root: V3,
) -> Vec<ReferenceGaussian> {
    let count = bound.triangles().len();
    (0..count)
        .map(|i| {
            let attribute: [f64; 14] = std::array::from_fn(|plane| {
                f64::from(bound.attributes()[plane * count + i])
                    + residuals.map_or(0.0, |r| r[i][plane])
            });
            let face = template.faces()[bound.triangles()[i] as usize];
            let [a, b, c] = face.map(|v| posed[v as usize]);
            let edge = sub(b, a);
            let x = scale(edge, 1.0 / norm(edge));
            let across = cross(x, sub(c, a));
            let z = scale(across, 1.0 / norm(across));
            let frame = transpose([x, cross(z, x), z]);
            let [v, w] = bound.barycentrics()[i].map(f64::from);
            let anchor = add(scale(a, 1.0 - v - w), add(scale(b, v), scale(c, w)));
            let [
                ox,
                oy,
                oz,
                qx,
                qy,
                qz,
                qw,
                sx,
                sy,
                sz,
                opacity_logit,
                red,
                green,
                blue,
            ] = attribute;
            ReferenceGaussian {
                position: add(add(anchor, mul_v(frame, [ox, oy, oz])), root),
                rotation: mul(frame, quaternion_matrix([qx, qy, qz, qw])),
                log_scale: [sx, sy, sz],
                opacity_logit,
                colour: [red, green, blue],
            }
        })
        .collect()
}
