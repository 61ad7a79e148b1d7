//! Hidden units for the controllers: a pool of random ramps on the joints that matter at a place, and the greedy choice
//! (simultaneous orthogonal matching pursuit, Tropp 2006) of the few that explain the residuals there.
//!
//! A ramp is a pair of SiLU units, silu(x) - silu(x - width): it rises once and then stays. So every force is bounded,
//! and a pose beyond all that was trained on cannot make a Gaussian grow without bound, as a single SiLU could.

use super::silu;
use crate::simulate::{Fabric, Puppet};
use half::f16;
use nalgebra::DMatrix;
use spmm3::{BODY, Joint, MotionParams, PARAMS};

/// Units in the pool of one controller.
const POOL: usize = 900;

/// Means and deviations of the 215 inputs over the training poses.
#[derive(Debug, Clone)]
pub(super) struct PoseStatistics {
    mean: Vec<f32>,
    deviation: Vec<f32>,
}

impl PoseStatistics {
    /// Measures `poses`.
    #[must_use]
    pub(super) fn new(poses: &[MotionParams]) -> Self {
        let count = poses.len().max(1) as f32;
        let mut mean = vec![0.0f32; PARAMS];
        let mut square = vec![0.0f32; PARAMS];
        for motion in poses {
            for ((m, s), v) in mean.iter_mut().zip(&mut square).zip(motion.values()) {
                *m += v / count;
                *s += v * v / count;
            }
        }
        let deviation = square
            .iter()
            .zip(&mean)
            .map(|(s, m)| (s - m * m).max(0.0).sqrt().max(0.05))
            .collect();
        Self { mean, deviation }
    }
}

/// Groups of inputs (a joint's three values, or one expression coefficient) that can matter at `vertex`.
///
/// The joints that carry it and those above them (the light comes from the room, so every joint between root and vertex
/// turns the surface in it), and what moves near it: shoulders and hips for the trunk, expressions for the face.
#[must_use]
pub(super) fn relevant_inputs(puppet: &Puppet, vertex: usize) -> Vec<Vec<usize>> {
    let skin = puppet.template.skin()[vertex].dense();
    let mut wanted = [false; spmm3::JOINTS];
    for joint in Joint::ALL {
        if skin[joint.index()] > 0.05 {
            let mut up = Some(joint);
            while let Some(j) = up {
                wanted[j.index()] = true;
                up = j.parent();
            }
        }
    }
    let held = |joints: &[Joint]| joints.iter().map(|j| skin[j.index()]).sum::<f32>();
    use Joint::{
        Head, Jaw, LeftCollar, LeftEye, LeftHip, LeftKnee, LeftShoulder, Neck, Pelvis, RightCollar,
        RightEye, RightHip, RightKnee, RightShoulder, Spine1, Spine2, Spine3,
    };
    if held(&[Spine2, Spine3, LeftCollar, RightCollar, Neck]) > 0.3 {
        for joint in [LeftCollar, RightCollar, LeftShoulder, RightShoulder] {
            wanted[joint.index()] = true;
        }
    }
    if held(&[Pelvis, Spine1, LeftHip, RightHip]) > 0.3
        || (puppet.looseness[vertex] > 0.02 && held(&[Spine2]) > 0.3)
    {
        for joint in [
            LeftHip,
            RightHip,
            LeftKnee,
            RightKnee,
            Spine1,
            Spine2,
            LeftShoulder,
            RightShoulder,
        ] {
            wanted[joint.index()] = true;
        }
    }
    let face = puppet.fabric[vertex] == Fabric::Face || held(&[Jaw, LeftEye, RightEye]) > 0.1;
    if face {
        for joint in [Head, Neck, Jaw] {
            wanted[joint.index()] = true;
        }
    }
    wanted[Pelvis.index()] = false;
    let mut groups: Vec<Vec<usize>> = Joint::ALL
        .into_iter()
        .filter(|joint| wanted[joint.index()])
        .map(|joint| (0..3).map(|k| MotionParams::offset_of(joint) + k).collect())
        .collect();
    if face {
        let expressions = puppet.expressions.iter().enumerate();
        groups.extend(
            expressions
                .filter(|(_, field)| field[vertex].length() > 1e-5)
                .map(|(e, _)| vec![BODY + e]),
        );
    }
    groups
}

/// The chosen ramps of one controller.
#[derive(Debug)]
pub(super) struct Units {
    /// First layer, row-major `[215, ramps]`, rounded to FP16 as stored. Both units of a ramp share it.
    pub(super) weights: Vec<f32>,
    /// Biases of each ramp's two units, `[ramps]`.
    pub(super) biases: Vec<[f32; 2]>,
    /// The ramps over the poses and a column of ones, `[poses, ramps + 1]`.
    pub(super) features: DMatrix<f64>,
}

/// Chooses `ramps` ramps on `groups` of inputs for `code` `[poses, B]`.
#[must_use]
pub(super) fn choose_units(
    groups: &[Vec<usize>],
    statistics: &PoseStatistics,
    poses: &[MotionParams],
    code: &DMatrix<f64>,
    ramps: usize,
    rng: &mut fastrand::Rng,
) -> Units {
    let candidates = candidates(groups, statistics, rng);
    let samples = poses.len();
    let evaluate = |ramp: &Candidate| -> Vec<f32> {
        poses
            .iter()
            .map(|motion| {
                let along: f32 = ramp
                    .inputs
                    .iter()
                    .map(|(input, w)| motion.values()[*input] * w)
                    .sum();
                silu(along + ramp.bias) - silu(along + ramp.bias - ramp.width)
            })
            .collect()
    };
    let centre = |column: &mut [f32]| {
        let mean = column.iter().sum::<f32>() / samples.max(1) as f32;
        column.iter_mut().for_each(|v| *v -= mean);
    };
    let values: Vec<Vec<f32>> = candidates.iter().map(evaluate).collect();
    let mut left: Vec<Vec<f32>> = values.clone();
    left.iter_mut().for_each(|c| centre(c));
    let mut residual: Vec<Vec<f32>> = code
        .column_iter()
        .map(|c| c.iter().copied().map(narrow).collect())
        .collect();
    residual.iter_mut().for_each(|c| centre(c));
    let full: Vec<f32> = left.iter().map(|c| dot(c, c)).collect();
    let mut chosen: Vec<usize> = Vec::with_capacity(ramps);
    for _ in 0..ramps {
        let score = |k: usize| {
            let norm = dot(&left[k], &left[k]);
            // A unit that is nearly a mix of those chosen would need huge weights, and so generalise badly.
            if norm < 0.02 * full[k] || full[k] < 1e-6 {
                return 0.0;
            }
            residual
                .iter()
                .map(|r| dot(&left[k], r).powi(2))
                .sum::<f32>()
                / norm
        };
        let scores: Vec<f32> = (0..candidates.len()).map(score).collect();
        let best =
            (0..candidates.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]).then(b.cmp(a)));
        let Some(best) = best.filter(|k| scores[*k] > 0.0 && !chosen.contains(k)) else {
            break;
        };
        chosen.push(best);
        let norm = dot(&left[best], &left[best]).sqrt();
        let direction: Vec<f32> = left[best].iter().map(|v| v / norm).collect();
        for column in left.iter_mut().chain(&mut residual) {
            let along = dot(column, &direction);
            for (value, d) in column.iter_mut().zip(&direction) {
                *value -= along * d;
            }
        }
    }
    let mut weights = vec![0.0; PARAMS * ramps];
    let mut biases = vec![[0.0; 2]; ramps];
    let mut features = DMatrix::zeros(samples, ramps + 1);
    features.column_mut(ramps).fill(1.0);
    for (r, k) in chosen.iter().enumerate() {
        let ramp = &candidates[*k];
        for (input, weight) in &ramp.inputs {
            weights[input * ramps + r] = *weight;
        }
        biases[r] = [ramp.bias, ramp.bias - ramp.width];
        for (n, value) in values[*k].iter().enumerate() {
            features[(n, r)] = f64::from(*value);
        }
    }
    Units {
        weights,
        biases,
        features,
    }
}

struct Candidate {
    inputs: Vec<(usize, f32)>,
    bias: f32,
    width: f32,
}

fn candidates(
    groups: &[Vec<usize>],
    statistics: &PoseStatistics,
    rng: &mut fastrand::Rng,
) -> Vec<Candidate> {
    if groups.is_empty() {
        return Vec::new();
    }
    let mut normal = {
        let mut rng = rng.fork();
        move || (0..4).map(|_| rng.f32() - 0.5).sum::<f32>() * 1.73
    };
    (0..POOL)
        .map(|_| {
            let mut inputs: Vec<(usize, f32)> = Vec::new();
            let joints = rng.usize(1..4).min(groups.len());
            let sharpness = [1.0, 2.0, 3.0][rng.usize(0..3)];
            for _ in 0..joints {
                let group = &groups[rng.usize(0..groups.len())];
                let alone = if rng.bool() {
                    Some(group[rng.usize(0..group.len())])
                } else {
                    None
                };
                for input in group.iter().filter(|i| alone.is_none_or(|a| a == **i)) {
                    if inputs.iter().all(|(known, _)| known != input) {
                        inputs.push((*input, sharpness * normal()));
                    }
                }
            }
            let norm = inputs
                .iter()
                .map(|(_, w)| w * w)
                .sum::<f32>()
                .sqrt()
                .max(1e-3);
            let mut bias = normal() * sharpness;
            for (input, weight) in &mut inputs {
                *weight *= sharpness * 1.5 / norm / statistics.deviation[*input];
                *weight = f16::from_f32(*weight).to_f32();
                bias -= *weight * statistics.mean[*input];
            }
            let width = [3.0, 6.0][rng.usize(0..2)];
            bias += 0.5 * width;
            Candidate {
                inputs,
                bias,
                width,
            }
        })
        .collect()
}

#[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
fn narrow(value: f64) -> f32 {
    value as f32
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    // Eight running sums: the compiler keeps them in one register.
    let mut sums = [0.0f32; 8];
    let (heads, tails) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = heads
        .remainder()
        .iter()
        .zip(tails.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in heads.zip(tails) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f32>() + rest
}
