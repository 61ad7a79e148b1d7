//! Fits F_mesh: 215 motion numbers -> canonical vertex offsets.
//!
//! The linear expression basis passes exactly, through pairs of units: silu(x) - silu(-x) = x. What is left of the rank
//! goes to the principal components of the simulated offsets, region by region. Each region is a perceptron of its own
//! inside the one network, on the joints that matter there, so that talking never moves the jacket.

use super::regions::{Region, regions};
use super::{Components, Perceptron, Training, components, silu};
use crate::simulate::Puppet;
use glam::Vec3;
use half::f16;
use nalgebra::DMatrix;
use rayon::prelude::*;
use spmm3::networks::{Dense, MeshNetwork, QuantisedDecoder};
use spmm3::{BODY, MotionParams, PARAMS, PersonError};

/// Units of each hidden layer.
const HIDDEN: usize = 256;
/// Offset fields.
const RANK: usize = 64;
/// Expression components at most.
const MAX_EXPRESSIONS: usize = 20;
/// Passes over the poses.
pub(crate) const EPOCHS: usize = 300;
/// How each region is trained.
const TRAINING: Training = Training {
    epochs: EPOCHS,
    batch: 64,
    rate: 3e-3,
    decay: 0.02,
    ridge: 3e-4,
};

/// F_mesh and what its principal components could explain at best.
#[derive(Debug, Clone)]
pub struct MeshFit {
    /// The network, quantised as it will be stored.
    pub network: MeshNetwork,
    /// Share of the training offsets' variance that the components of the hanging cloth explain, 0..=1.
    pub explained: f64,
}

/// One part of the network: some inputs, some hidden units, some fields over some columns.
struct Part {
    inputs: Vec<usize>,
    net: Perceptron,
    found: Components,
    columns: Vec<usize>,
}

/// Fits F_mesh to `offsets` (one `[N_v]` field a pose, the linear expression not included).
///
/// `done` is called once per pass over the poses, all regions together.
///
/// # Errors
/// If the result does not make a network, which takes offsets that are not finite.
pub fn fit_mesh(
    puppet: &Puppet,
    poses: &[MotionParams],
    offsets: &[Vec<Vec3>],
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<MeshFit, PersonError> {
    let vertices = puppet.template.vertices().len();
    let expressions = puppet.expressions.len().min(MAX_EXPRESSIONS);
    let (region_of, all) = regions(
        puppet,
        expressions,
        HIDDEN - 2 * expressions,
        RANK - expressions,
    );
    let parts: Vec<Part> = all
        .into_par_iter()
        .enumerate()
        .map(|(r, region)| {
            let own: Vec<usize> = (0..vertices).filter(|v| region_of[*v] == r).collect();
            let rng = fastrand::Rng::with_seed(seed.wrapping_mul(31).wrapping_add(r as u64));
            part(&region, &own, poses, offsets, rng, || {
                if r == 0 {
                    done();
                }
            })
        })
        .collect();
    let explained = parts.first().map_or(1.0, |p| p.found.explained);
    let network = assemble(puppet, expressions, &parts)?;
    Ok(MeshFit { network, explained })
}

/// Fits one region: `own` are its vertices.
fn part(
    region: &Region,
    own: &[usize],
    poses: &[MotionParams],
    offsets: &[Vec<Vec3>],
    mut rng: fastrand::Rng,
    done: impl FnMut(),
) -> Part {
    let vertices = offsets.first().map_or(0, Vec::len);
    let samples: Vec<Vec<f32>> = offsets
        .iter()
        .map(|field| {
            (0..3)
                .flat_map(|axis| own.iter().map(move |v| field[*v][axis]))
                .collect()
        })
        .collect();
    let columns = (0..3)
        .flat_map(|axis| own.iter().map(move |v| axis * vertices + v))
        .collect();
    let found = components(&samples, &vec![1.0; 3 * own.len()], region.fields);
    let inputs: Vec<usize> = region.groups.iter().flatten().copied().collect();
    let mut first = 0;
    let groups: Vec<Vec<usize>> = region
        .groups
        .iter()
        .map(|group| {
            first += group.len();
            (first - group.len()..first).collect()
        })
        .collect();
    // Each code counts by the movement its field makes.
    let strength: Vec<f32> = found
        .fields
        .iter()
        .map(|f| f.iter().map(|v| v * v).sum::<f32>().sqrt())
        .collect();
    let top = strength.iter().fold(1e-9f32, |a, b| a.max(*b));
    let targets = DMatrix::from_fn(region.fields, poses.len(), |k, n| {
        #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
        let code = found.codes[(n, k)] as f32;
        code * strength[k] / top
    });
    let seen = select(&inputs, poses);
    let mut net = Perceptron::random(inputs.len(), region.units, region.fields, &groups, &mut rng);
    net.train(&seen, &targets, TRAINING, &mut rng, done);
    for layer in 0..2 {
        net.weights[layer]
            .iter_mut()
            .for_each(|w| *w = f16::from_f32(*w).to_f32());
    }
    net.solve_last(&seen, &targets, TRAINING.ridge);
    for (k, s) in strength.iter().enumerate() {
        // Back from movement to code units; a field that never moves has no code.
        let back = if *s > 1e-9 { top / s } else { 0.0 };
        net.weights[2].row_mut(k).scale_mut(back);
        net.biases[2][k] *= back;
    }
    Part {
        inputs,
        net,
        found,
        columns,
    }
}

fn select(inputs: &[usize], poses: &[MotionParams]) -> DMatrix<f32> {
    DMatrix::from_fn(inputs.len(), poses.len(), |k, n| {
        poses[n].values()[inputs[k]]
    })
}

/// Lays the expression's pairs and the parts side by side in the three layers.
fn assemble(
    puppet: &Puppet,
    expressions: usize,
    parts: &[Part],
) -> Result<MeshNetwork, PersonError> {
    let columns = 3 * puppet.template.vertices().len();
    let mut mean = vec![0.0f32; columns];
    let mut first = vec![0.0f32; PARAMS * HIDDEN];
    let mut second = vec![0.0f32; HIDDEN * HIDDEN];
    let mut code = vec![0.0f32; HIDDEN * RANK];
    let (mut first_bias, mut second_bias, mut code_bias) =
        (vec![0.0; HIDDEN], vec![0.0; HIDDEN], vec![0.0; RANK]);
    let mut fields = vec![0.0f32; RANK * columns];
    for e in 0..expressions {
        let (plus, minus) = (2 * e, 2 * e + 1);
        first[(BODY + e) * HIDDEN + plus] = 1.0;
        first[(BODY + e) * HIDDEN + minus] = -1.0;
        for (to, sign) in [(plus, 1.0), (minus, -1.0)] {
            second[plus * HIDDEN + to] = sign;
            second[minus * HIDDEN + to] = -sign;
        }
        code[plus * RANK + e] = 1.0;
        code[minus * RANK + e] = -1.0;
        fields[e * columns..(e + 1) * columns].copy_from_slice(&planes(&puppet.expressions[e]));
    }
    let (mut unit, mut rank) = (2 * expressions, expressions);
    for part in parts {
        let [w1, w2, w3] = &part.net.weights;
        let [b1, b2, b3] = &part.net.biases;
        for h in 0..w1.nrows() {
            for (k, input) in part.inputs.iter().enumerate() {
                first[input * HIDDEN + unit + h] = w1[(h, k)];
            }
            for from in 0..w2.ncols() {
                second[(unit + from) * HIDDEN + unit + h] = w2[(h, from)];
            }
            for r in 0..w3.nrows() {
                code[(unit + h) * RANK + rank + r] = w3[(r, h)];
            }
            (first_bias[unit + h], second_bias[unit + h]) = (b1[h], b2[h]);
        }
        for (at, value) in part.columns.iter().zip(&part.found.mean) {
            mean[*at] = *value;
        }
        for (r, field) in part.found.fields.iter().enumerate() {
            code_bias[rank + r] = b3[r];
            for (at, value) in part.columns.iter().zip(field) {
                fields[(rank + r) * columns + at] = *value;
            }
        }
        unit += w1.nrows();
        rank += part.found.fields.len();
    }
    Ok(MeshNetwork {
        first: Dense::new(PARAMS, HIDDEN, &first, first_bias)?,
        second: Dense::new(HIDDEN, HIDDEN, &second, second_bias)?,
        code: Dense::new(HIDDEN, RANK, &code, code_bias)?,
        decoder: QuantisedDecoder::quantise(RANK, &fields, mean)?,
    })
}

/// F_mesh's code of one pose: the weights of its offset fields.
#[must_use]
pub fn mesh_code(network: &MeshNetwork, motion: &MotionParams) -> Vec<f32> {
    let hidden = dense(&network.first, motion.values());
    let hidden = dense(
        &network.second,
        &hidden.into_iter().map(silu).collect::<Vec<_>>(),
    );
    dense(
        &network.code,
        &hidden.into_iter().map(silu).collect::<Vec<_>>(),
    )
}

/// Runs F_mesh as stored: canonical offsets of one pose, metres, expression included. `fields` is its dequantised decoder.
#[must_use]
pub fn mesh_offsets(network: &MeshNetwork, fields: &[f32], motion: &MotionParams) -> Vec<Vec3> {
    let code = mesh_code(network, motion);
    let mut sum = network.decoder.mean().to_vec();
    for (row, weight) in fields.chunks_exact(sum.len()).zip(code) {
        for (s, f) in sum.iter_mut().zip(row) {
            *s += weight * f;
        }
    }
    let vertices = sum.len() / 3;
    (0..vertices)
        .map(|v| Vec3::new(sum[v], sum[vertices + v], sum[2 * vertices + v]))
        .collect()
}

/// y = x W + b.
pub(super) fn dense(layer: &Dense, x: &[f32]) -> Vec<f32> {
    let mut y = layer.bias().to_vec();
    for (row, value) in layer.weights().chunks_exact(layer.outputs()).zip(x) {
        if *value != 0.0 {
            for (sum, weight) in y.iter_mut().zip(row) {
                *sum += value * weight.to_f32();
            }
        }
    }
    y
}

fn planes(field: &[Vec3]) -> Vec<f32> {
    (0..3)
        .flat_map(|axis| field.iter().map(move |v| v[axis]))
        .collect()
}
