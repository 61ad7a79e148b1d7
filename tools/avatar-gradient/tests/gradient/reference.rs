//! The model in f64, written from the paper's formulas and apart from the code under test: rotations are matrices, sums run vertex by vertex
//! and Gaussian by Gaussian.

use crate::people::Person;
use glam::{DMat3, DQuat, DVec3};
use synthetic_person::reference::{
    M3, PARENTS, Rigid, V3, add, cross, mul, mul_v, norm, rodrigues, scale, skin, sub, transpose,
    wide,
};

/// All numbers of the parameters in the order of `Parameters::arrays`, then P, then the root translation.
#[derive(Debug, Clone)]
pub(crate) struct Numbers {
    pub(crate) arrays: Vec<Vec<f64>>,
    pub(crate) p: Vec<f64>,
    pub(crate) root: V3,
}

impl Numbers {
    pub(crate) fn new(person: &Person, motion: &spmm3::MotionParams) -> Self {
        let widened = |array: &[f32]| array.iter().map(|x| f64::from(*x)).collect();
        Self {
            arrays: person
                .parameters
                .arrays()
                .into_iter()
                .map(|(_, array)| widened(array))
                .collect(),
            p: widened(motion.values()),
            root: wide(motion.root_translation),
        }
    }
}

/// Which array is where.
mod at {
    pub(super) const GAUSSIANS: usize = 0;
    pub(super) const BASES: usize = 1;
    pub(super) const CONTROLLERS_FIRST: usize = 2;
    pub(super) const CONTROLLERS_SECOND: usize = 4;
    pub(super) const MESH_FIRST: usize = 6;
    pub(super) const MESH_SECOND: usize = 8;
    pub(super) const MESH_CODE: usize = 10;
    pub(super) const FIELDS: usize = 12;
    pub(super) const MEAN: usize = 13;
}

/// What the model computes.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) vertices: Vec<V3>,
    /// In the order of `splat_gradient::Attributes`.
    pub(crate) gaussians: Vec<[f64; 14]>,
    /// Delta x of each controller.
    pub(crate) offsets: Vec<V3>,
}

fn layer(x: &[f64], weights: &[f64], bias: &[f64]) -> Vec<f64> {
    (0..bias.len())
        .map(|o| {
            let products = x.iter().enumerate();
            bias[o]
                + products
                    .map(|(i, x)| x * weights[i * bias.len() + o])
                    .sum::<f64>()
        })
        .collect()
}

fn silu(x: Vec<f64>) -> Vec<f64> {
    x.into_iter().map(|x| x / (1.0 + (-x).exp())).collect()
}

fn frame([a, b, c]: [V3; 3]) -> M3 {
    let x = scale(sub(b, a), 1.0 / norm(sub(b, a)));
    let across = cross(x, sub(c, a));
    let n = scale(across, 1.0 / norm(across));
    transpose([x, cross(n, x), n])
}

pub(crate) fn pose(person: &Person, numbers: &Numbers) -> Outcome {
    let arrays = &numbers.arrays;
    let dense = |x: &[f64], first: usize| layer(x, &arrays[first], &arrays[first + 1]);
    let template = &person.puppet.template;

    let hidden = silu(dense(&numbers.p, at::MESH_FIRST));
    let hidden = silu(dense(&hidden, at::MESH_SECOND));
    let code = dense(&hidden, at::MESH_CODE);
    let count = template.vertices().len();
    let canonical: Vec<V3> = (0..count)
        .map(|v| {
            let rest = wide(template.vertices()[v]);
            std::array::from_fn(|axis| {
                let column = axis * count + v;
                let fields = code.iter().enumerate();
                let moved =
                    fields.map(|(r, code)| code * arrays[at::FIELDS][r * 3 * count + column]);
                rest[axis] + arrays[at::MEAN][column] + moved.sum::<f64>()
            })
        })
        .collect();

    let rests = person.puppet.skeleton.rest_positions().map(wide);
    let mut joints: Vec<Rigid> = Vec::new();
    for (j, parent) in PARENTS.into_iter().enumerate() {
        let first = if j < 25 { 3 * j } else { 125 + 3 * (j - 25) };
        let turn = rodrigues([0, 1, 2].map(|k| numbers.p[first + k]));
        joints.push(if j == 0 {
            Rigid {
                rotation: turn,
                translation: rests[0],
            }
        } else {
            Rigid {
                rotation: mul(joints[parent].rotation, turn),
                translation: joints[parent].apply(sub(rests[j], rests[parent])),
            }
        });
    }
    let posed_from_rest: Vec<Rigid> = joints
        .iter()
        .zip(rests)
        .map(|(joint, rest)| Rigid {
            rotation: joint.rotation,
            translation: sub(joint.translation, mul_v(joint.rotation, rest)),
        })
        .collect();
    let vertices: Vec<V3> = skin(template, &canonical, &posed_from_rest)
        .into_iter()
        .map(|v| add(v, numbers.root))
        .collect();

    let controllers = person.puppet.controllers.vertices().len();
    let units = silu(dense(&numbers.p, at::CONTROLLERS_FIRST));
    let hidden = units.len() / controllers;
    let bases = arrays[at::CONTROLLERS_SECOND + 1].len() / controllers;
    let potential = |c: usize, b: usize| {
        let products = (0..hidden).map(|h| {
            let unit = c * hidden + h;
            units[unit] * arrays[at::CONTROLLERS_SECOND][unit * bases + b]
        });
        arrays[at::CONTROLLERS_SECOND + 1][c * bases + b] + products.sum::<f64>()
    };
    let potentials: Vec<Vec<f64>> = (0..controllers)
        .map(|c| (0..bases).map(|b| potential(c, b)).collect())
        .collect();

    let bound = &person.puppet.gaussians;
    let n = bound.len();
    let basis = |plane: usize, b: usize, i: usize| arrays[at::BASES][(plane * bases + b) * n + i];
    let gaussians = (0..n)
        .map(|i| {
            let holds = person.puppet.controllers.neighbours()[i]
                .into_iter()
                .zip(person.puppet.controllers.masses()[i]);
            let force = |b: usize| {
                let shares = holds.clone();
                shares
                    .map(|(c, mass)| f64::from(mass) * potentials[usize::from(c)][b])
                    .sum::<f64>()
            };
            let local: [f64; 14] = std::array::from_fn(|plane| {
                arrays[at::GAUSSIANS][plane * n + i]
                    + (0..bases)
                        .map(|b| force(b) * basis(plane, b, i))
                        .sum::<f64>()
            });
            let [a, b, c] = bound.corners()[i].map(|v| vertices[v as usize]);
            let axes = frame([a, b, c]);
            let [v, w] = bound.barycentrics()[i].map(f64::from);
            let anchor = add(scale(a, 1.0 - v - w), add(scale(b, v), scale(c, w)));
            let place = add(anchor, mul_v(axes, [local[0], local[1], local[2]]));
            let [x, y, n] = transpose(axes).map(DVec3::from_array);
            let world_from_local = DQuat::from_mat3(&DMat3::from_cols(x, y, n));
            let own = DQuat::from_xyzw(local[3], local[4], local[5], local[6]).normalize();
            let turn = world_from_local * own;
            let shown = |k: usize| 0.5 + 0.282_094_791_773_878_14 * local[k];
            [
                place[0],
                place[1],
                place[2],
                turn.x,
                turn.y,
                turn.z,
                turn.w,
                local[7],
                local[8],
                local[9],
                local[10],
                shown(11),
                shown(12),
                shown(13),
            ]
        })
        .collect();

    let rest_frame =
        |i: usize| frame(bound.corners()[i].map(|v| wide(template.vertices()[v as usize])));
    let mut sums = vec![([0.0; 3], 0.0); controllers];
    for i in 0..n {
        let held = person.puppet.controllers.neighbours()[i];
        for (c, mass) in held.into_iter().zip(person.puppet.controllers.masses()[i]) {
            let c = usize::from(c);
            let alone: V3 = std::array::from_fn(|axis| {
                (0..bases)
                    .map(|b| potentials[c][b] * basis(axis, b, i))
                    .sum()
            });
            let turned = mul_v(rest_frame(i), alone);
            sums[c].0 = add(sums[c].0, scale(turned, f64::from(mass)));
            sums[c].1 += f64::from(mass);
        }
    }
    let mean = |(sum, mass): (V3, f64)| {
        if mass > 0.0 {
            scale(sum, 1.0 / mass)
        } else {
            sum
        }
    };
    Outcome {
        vertices,
        gaussians,
        offsets: sums.into_iter().map(mean).collect(),
    }
}

/// Quaternions of both signs say one rotation: those of `outcome` are given the signs of `like`, planes of x, y, z, w.
pub(crate) fn align(outcome: &mut Outcome, like: [&[f32]; 4]) {
    for (i, gaussian) in outcome.gaussians.iter_mut().enumerate() {
        let dot: f64 = (0..4)
            .map(|k| gaussian[3 + k] * f64::from(like[k][i]))
            .sum();
        if dot < 0.0 {
            for number in &mut gaussian[3..7] {
                *number = -*number;
            }
        }
    }
}
