//! Fits F_attr: 500 local controllers, and fifteen bases a Gaussian that their potentials weigh (paper, section IV-B).
//!
//! In four steps, each closed-form or greedy: (1) the residuals of the Gaussians around a controller over the training poses, as
//! a temporal code of B numbers; (2) the few hidden units, out of a pool of random ones on the joints that matter there,
//! that explain the code best; (3) neighbouring codes turned to agree, so that mixing them by virtual mass makes sense
//! (orthogonal Procrustes; the paper penalises the difference of neighbours instead, its guide coherence loss); (4) with the forces as predicted, each Gaussian's bases by ridge regression.

use super::deformer::{force, potentials, residuals};
use super::{Frame, Targets, pool, procrustes, ridge, solve_ridge, temporal_codes};
use crate::simulate::Puppet;
use half::f16;
use nalgebra::DMatrix;
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, Dense, QuantisedBases};
use spmm3::{ATTRIBUTES, Controllers, MotionParams, PARAMS, PersonError};

/// Gaussians around a controller that its code is made from.
const WITNESSES: usize = 24;
/// The weight of each attribute's error: about 4 mm of place, 0.15 of a quaternion, a quarter of a
/// log-scale, or 0.07 of a colour channel look alike.
const WORTH: [f32; ATTRIBUTES] = [
    250.0, 250.0, 250.0, 7.0, 7.0, 7.0, 7.0, 4.0, 4.0, 4.0, 1.0, 4.0, 4.0, 4.0,
];

/// Sizes and strengths of the fit.
#[derive(Debug, Clone, Copy)]
pub struct AttributeOptions {
    /// B, bases per Gaussian.
    pub bases: usize,
    /// Hidden units per controller, two to a ramp: even.
    pub hidden: usize,
    /// Ridge strength of the controllers' second layer.
    pub controller_ridge: f64,
    /// Ridge strength of the Gaussians' bases.
    pub basis_ridge: f64,
}

impl Default for AttributeOptions {
    fn default() -> Self {
        Self {
            bases: 15,
            hidden: 16,
            controller_ridge: 3e-3,
            basis_ridge: 3e-3,
        }
    }
}

/// F_attr and what storing its bases in 8 bits costs.
#[derive(Debug, Clone)]
pub struct AttributeFit {
    /// The network, quantised as it will be stored.
    pub network: AttributeNetwork,
    /// Root mean square error of each attribute plane that the 8 bits alone cause, over some training poses.
    pub quantisation: [f32; ATTRIBUTES],
}

/// Training poses with their targets, one frame a pose.
#[derive(Debug, Clone, Copy)]
pub struct Lessons<'a> {
    /// The poses.
    pub poses: &'a [MotionParams],
    /// Their meshes and light.
    pub frames: &'a [Frame],
}

/// What F_attr is to give: the residuals of Gaussians in training poses.
pub trait Residuals: Sync {
    /// Number of Gaussians.
    fn gaussians(&self) -> usize;
    /// The 14 residuals of a Gaussian in the training pose of that number, in the order of the attribute planes.
    fn residual(&self, gaussian: usize, pose: usize) -> [f32; ATTRIBUTES];
}

/// Targets in the frames of the training poses.
struct Framed<'a> {
    targets: &'a Targets,
    frames: &'a [Frame],
}

impl Residuals for Framed<'_> {
    fn gaussians(&self) -> usize {
        self.targets.len()
    }

    fn residual(&self, gaussian: usize, pose: usize) -> [f32; ATTRIBUTES] {
        self.targets.residual(gaussian, &self.frames[pose])
    }
}

/// One controller's fit, its code not yet aligned.
struct Local {
    units: pool::Units,
    /// Temporal code, `[poses, B]`.
    code: DMatrix<f64>,
}

/// Fits F_attr to `lessons`; `done` is called after each controller.
///
/// # Errors
/// If the result does not make a network, which takes targets that are not finite.
pub fn fit_attributes(
    puppet: &Puppet,
    controllers: &Controllers,
    targets: &Targets,
    lessons: Lessons<'_>,
    options: AttributeOptions,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<AttributeFit, PersonError> {
    let Lessons { poses, frames } = lessons;
    let framed = Framed { targets, frames };
    fit_residuals(puppet, controllers, &framed, poses, options, seed, done)
}

/// Fits F_attr to the `wanted` residuals of `poses`; `done` is called after each controller.
///
/// # Errors
/// If the result does not make a network, which takes residuals that are not finite.
pub fn fit_residuals(
    puppet: &Puppet,
    controllers: &Controllers,
    wanted: &impl Residuals,
    poses: &[MotionParams],
    options: AttributeOptions,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<AttributeFit, PersonError> {
    let members = members(controllers);
    let statistics = pool::PoseStatistics::new(poses);
    let locals: Vec<Local> = members
        .par_iter()
        .enumerate()
        .map(|(j, own)| {
            let mut rng =
                fastrand::Rng::with_seed(seed ^ (j as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            let inputs = pool::relevant_inputs(puppet, controllers.vertices()[j] as usize);
            let data = witness_data(wanted, poses.len(), own);
            let code = padded(
                &temporal_codes(&data, options.bases, &mut rng),
                options.bases,
            );
            let units = pool::choose_units(
                &inputs,
                &statistics,
                poses,
                &code,
                options.hidden / 2,
                &mut rng,
            );
            done();
            Local { units, code }
        })
        .collect();

    let ramps = options.hidden / 2;
    let count = locals.len();
    let width = 2 * ramps * count;
    let mut first = vec![0.0f32; PARAMS * width];
    let mut first_bias = Vec::with_capacity(width);
    for (j, local) in locals.iter().enumerate() {
        for (input, row) in local.units.weights.chunks_exact(ramps.max(1)).enumerate() {
            for (ramp, weight) in row.iter().enumerate() {
                let at = input * width + 2 * (j * ramps + ramp);
                first[at..at + 2].fill(*weight);
            }
        }
        first_bias.extend(local.units.biases.iter().flatten());
    }
    let (second, second_bias) = second_layers(controllers, &locals, options);
    let empty = QuantisedBases::quantise(options.bases, 0, &[])?;
    let mut network = AttributeNetwork {
        first: Dense::new(PARAMS, width, &first, first_bias)?,
        second,
        second_bias,
        bases: empty,
    };
    let full = fit_bases(controllers, &network, wanted, poses, options);
    network.bases = QuantisedBases::quantise(options.bases, wanted.gaussians(), &full)?;
    let quantisation = quantisation_error(controllers, &network, full, poses);
    Ok(AttributeFit {
        network,
        quantisation,
    })
}

/// What the rounded bases give less what the `full` ones give: the network is linear in them.
fn quantisation_error(
    controllers: &Controllers,
    network: &AttributeNetwork,
    full: Vec<f32>,
    poses: &[MotionParams],
) -> [f32; ATTRIBUTES] {
    const SOME: usize = 8;
    let mut difference = network.bases.dequantise();
    difference.iter_mut().zip(full).for_each(|(q, f)| *q -= f);
    let count = network.bases.gaussians().max(1);
    let mut squares = [0.0f32; ATTRIBUTES];
    let some = &poses[..SOME.min(poses.len())];
    for motion in some {
        let errors = residuals(network, &difference, controllers, motion);
        for (square, plane) in squares.iter_mut().zip(errors.chunks_exact(count)) {
            *square += plane.iter().map(|e| e * e).sum::<f32>() / count as f32;
        }
    }
    squares.map(|square| (square / some.len().max(1) as f32).sqrt())
}

/// For each controller a sample of the Gaussians it holds, the strongest first.
fn members(controllers: &Controllers) -> Vec<Vec<usize>> {
    let count = controllers.vertices().len();
    let mut all: [Vec<Vec<usize>>; 2] = [vec![Vec::new(); count], vec![Vec::new(); count]];
    for (i, near) in controllers.neighbours().iter().enumerate() {
        all[0][usize::from(near[0])].push(i);
        for other in &near[1..] {
            all[1][usize::from(*other)].push(i);
        }
    }
    let [own, shared] = all;
    own.into_iter()
        .zip(shared)
        .map(|(own, shared)| {
            let take = |list: Vec<usize>, most: usize| -> Vec<usize> {
                let step = list.len().div_ceil(most).max(1);
                list.into_iter().step_by(step).collect()
            };
            let mut kept = take(own, WITNESSES * 3 / 4);
            let room = WITNESSES - kept.len();
            kept.extend(take(shared, room.max(1)));
            kept
        })
        .collect()
}

fn witness_data(wanted: &impl Residuals, poses: usize, own: &[usize]) -> DMatrix<f32> {
    let mut data = DMatrix::zeros(poses, (own.len() * ATTRIBUTES).max(1));
    for n in 0..poses {
        for (k, i) in own.iter().enumerate() {
            let residual = wanted.residual(*i, n);
            for (plane, (value, worth)) in residual.iter().zip(WORTH).enumerate() {
                data[(n, k * ATTRIBUTES + plane)] = value * worth;
            }
        }
    }
    data
}

fn padded(code: &DMatrix<f64>, columns: usize) -> DMatrix<f64> {
    code.clone().resize_horizontally(columns, 0.0)
}

/// Turns the codes to agree along a tree of neighbours, then fits each controller's second layer to its code.
fn second_layers(
    controllers: &Controllers,
    locals: &[Local],
    options: AttributeOptions,
) -> (Vec<f16>, Vec<f32>) {
    let bases = options.bases;
    let mut aligned: Vec<Option<DMatrix<f64>>> = vec![None; locals.len()];
    let strength = |code: &DMatrix<f64>| code.norm_squared();
    for (from, to) in spanning_order(controllers) {
        let code = &locals[to].code;
        let turned = match from.and_then(|f| aligned[f].as_ref()) {
            Some(reference) => code * procrustes(code, reference),
            None => code.clone(),
        };
        aligned[to] = Some(turned);
    }
    // One scale for all: forces of about 1 use FP16 and the 8-bit bases well.
    let mean = locals.iter().map(|l| strength(&l.code)).sum::<f64>() / locals.len().max(1) as f64;
    let poses = locals.first().map_or(1, |l| l.code.nrows()) as f64;
    let scale = (mean / poses / bases as f64).sqrt().max(1e-9);
    let solved: Vec<DMatrix<f64>> = locals
        .par_iter()
        .zip(&aligned)
        .map(|(local, code)| {
            let code = code.as_ref().unwrap_or(&local.code) / scale;
            ridge(
                &local.units.features,
                &code,
                options.controller_ridge,
                Some(options.hidden / 2),
            )
        })
        .collect();
    let ramps = options.hidden / 2;
    let mut second = Vec::with_capacity(locals.len() * 2 * ramps * bases);
    let mut bias = Vec::with_capacity(locals.len() * bases);
    for weights in solved {
        for ramp in 0..ramps {
            // A ramp is its first unit less its second.
            second.extend((0..bases).map(|b| f16::from_f64(weights[(ramp, b)])));
            second.extend((0..bases).map(|b| f16::from_f64(-weights[(ramp, b)])));
        }
        #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
        bias.extend((0..bases).map(|b| weights[(ramps, b)] as f32));
    }
    (second, bias)
}

/// Controllers in an order in which each (but the first of an island) follows the neighbour it shares most Gaussians with.
fn spanning_order(controllers: &Controllers) -> Vec<(Option<usize>, usize)> {
    let count = controllers.vertices().len();
    let mut shared = vec![0.0f32; count * count];
    for (near, masses) in controllers.neighbours().iter().zip(controllers.masses()) {
        for a in 0..near.len() {
            for b in 0..near.len() {
                if a != b {
                    shared[usize::from(near[a]) * count + usize::from(near[b])] +=
                        masses[a] * masses[b];
                }
            }
        }
    }
    let mut best: Vec<(f32, Option<usize>)> = vec![(0.0, None); count];
    let mut placed = vec![false; count];
    let mut order = Vec::with_capacity(count);
    for _ in 0..count {
        let next = (0..count)
            .filter(|c| !placed[*c])
            .max_by(|a, b| best[*a].0.total_cmp(&best[*b].0).then(b.cmp(a)));
        let Some(next) = next else { break };
        placed[next] = true;
        order.push((best[next].1, next));
        for other in 0..count {
            let tie = shared[next * count + other];
            if tie > best[other].0 {
                best[other] = (tie, Some(next));
            }
        }
    }
    order
}

/// Each Gaussian's bases, row-major `[14, B, N_g]`, given the forces that the controllers really predict.
fn fit_bases(
    controllers: &Controllers,
    network: &AttributeNetwork,
    wanted: &impl Residuals,
    poses: &[MotionParams],
    options: AttributeOptions,
) -> Vec<f32> {
    let bases = options.bases;
    let potentials: Vec<Vec<f32>> = poses
        .par_iter()
        .map(|motion| potentials(network, motion))
        .collect();
    let count = wanted.gaussians();
    let solved: Vec<Vec<f32>> = (0..count)
        .into_par_iter()
        .map(|i| {
            let mut square = DMatrix::<f64>::zeros(bases, bases);
            let mut right = DMatrix::<f64>::zeros(bases, ATTRIBUTES);
            let mut own = vec![0.0f32; bases];
            for (pose, potentials) in potentials.iter().enumerate() {
                force(controllers, potentials, bases, i, &mut own);
                let residual = wanted.residual(i, pose);
                for b in 0..bases {
                    let f = f64::from(own[b]);
                    for (c, other) in own.iter().enumerate().take(b + 1) {
                        square[(b, c)] += f * f64::from(*other);
                    }
                    for (plane, value) in residual.iter().enumerate() {
                        right[(b, plane)] += f * f64::from(*value);
                    }
                }
            }
            square.fill_upper_triangle_with_lower_triangle();
            let solved = solve_ridge(square, &right, options.basis_ridge, None);
            #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
            let row = solved.iter().map(|v| *v as f32).collect();
            row
        })
        .collect();
    let mut full = vec![0.0f32; ATTRIBUTES * bases * count];
    for (i, row) in solved.iter().enumerate() {
        for (at, value) in row.iter().enumerate() {
            // `row` is column-major [B, 14]: exactly [14, B] row-major.
            full[at * count + i] = *value;
        }
    }
    full
}
