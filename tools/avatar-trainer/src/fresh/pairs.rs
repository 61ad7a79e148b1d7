//! Features of a pose that stay within bounds, whatever the pose.
//!
//! SiLU grows with what it is given: a network of single units says most about the poses that are farthest from all it has learnt. So hidden units
//! stand in pairs that see the same, half a step ahead of it and half a step behind, and whose outputs are weighed oppositely:
//! SiLU(x + R) - SiLU(x - R) rises from 0 to 2 R as x does, is straight while |x| < R, and stays beyond.

use avatar_gradient::{Layer, Parameters};
use rayon::prelude::*;

/// R: about so many standard deviations of the capture's poses are within the straight part.
pub(super) const REACH: f32 = 1.5;

/// Which hidden units of the first layers stand in pairs: all from these numbers on. Those of a package that came with networks may stand alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Pairs {
    controllers: usize,
    mesh: usize,
}

impl Pairs {
    /// Those of an avatar's networks.
    pub(crate) fn of(parameters: &Parameters) -> Self {
        Self {
            controllers: first_pair(
                &parameters.controllers_first,
                &parameters.controllers_second,
            ),
            mesh: first_pair(&parameters.mesh_first, &parameters.mesh_second.weights),
        }
    }

    /// Makes pairs of them again, which a step of an optimiser moved apart.
    pub(crate) fn keep(&self, parameters: &mut Parameters) {
        let second = &mut parameters.controllers_second;
        pair(&mut parameters.controllers_first, second, self.controllers);
        let second = &mut parameters.mesh_second.weights;
        pair(&mut parameters.mesh_first, second, self.mesh);
    }
}

/// The first unit from which on all stand in pairs. `second` has a row of weights for each unit of `first`.
fn first_pair(first: &Layer, second: &[f32]) -> usize {
    let units = first.bias.len();
    let width = second.len() / units.max(1);
    let mut from = units;
    while from >= 2 {
        let (ahead, behind) = (from - 2, from - 1);
        let mut inputs = first.weights.chunks_exact(units);
        let row = |unit: usize| &second[unit * width..(unit + 1) * width];
        let opposite = row(ahead).iter().zip(row(behind)).all(|(a, b)| *a == -*b);
        let apart = (first.bias[ahead] - first.bias[behind] - 2.0 * REACH).abs();
        if !opposite || apart > 1e-3 || inputs.any(|row| row[ahead] != row[behind]) {
            break;
        }
        from = ahead;
    }
    from
}

fn pair(first: &mut Layer, second: &mut [f32], from: usize) {
    let units = first.bias.len();
    if from >= units {
        return;
    }
    let width = second.len() / units;
    first.weights.par_chunks_exact_mut(units).for_each(|row| {
        for pair in row[from..].chunks_exact_mut(2) {
            pair.fill(0.5 * (pair[0] + pair[1]));
        }
    });
    for pair in first.bias[from..].chunks_exact_mut(2) {
        let middle = 0.5 * (pair[0] + pair[1]);
        pair.copy_from_slice(&[middle + REACH, middle - REACH]);
    }
    let rows = second[from * width..].par_chunks_exact_mut(2 * width.max(1));
    rows.for_each(|rows| {
        let (ahead, behind) = rows.split_at_mut(width);
        for (ahead, behind) in ahead.iter_mut().zip(behind) {
            *ahead = 0.5 * (*ahead - *behind);
            *behind = -*ahead;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn silu(x: f32) -> f32 {
        x / (1.0 + (-x).exp())
    }

    /// Three inputs, two units that stand alone and four that are to be pairs, two outputs.
    fn network() -> (Layer, Vec<f32>) {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut some = |count: usize| (0..count).map(|_| rng.f32() - 0.5).collect();
        let first = Layer {
            weights: some(3 * 6),
            bias: some(6),
        };
        (first, some(6 * 2))
    }

    #[test]
    fn pairs_are_found_again_and_a_unit_that_stands_alone_is_left_alone() {
        let (mut first, mut second) = network();
        assert_eq!(first_pair(&first, &second), 6, "none yet");
        let alone = (first.bias[..2].to_vec(), second[..4].to_vec());
        pair(&mut first, &mut second, 2);
        assert_eq!(first_pair(&first, &second), 2, "four units");
        assert_eq!(
            (&first.bias[..2], &second[..4]),
            (&alone.0[..], &alone.1[..])
        );
    }

    #[test]
    fn a_pose_far_away_gives_no_more_than_its_features_bounds() {
        let (mut first, mut second) = network();
        pair(&mut first, &mut second, 2);
        for size in [1.0f32, 100.0, 1e4] {
            for sign in [-1.0, 1.0] {
                let of = |unit: usize| {
                    let x: f32 = (0..3)
                        .map(|input| sign * size * first.weights[6 * input + unit])
                        .sum();
                    silu(x + first.bias[unit])
                };
                for output in 0..2 {
                    let sum: f32 = (2..6)
                        .map(|unit| of(unit) * second[2 * unit + output])
                        .sum();
                    let bound: f32 = (1..3).map(|k| second[4 * k + output].abs()).sum::<f32>();
                    // SiLU dips to -0.28 before it rises.
                    assert!(sum.abs() <= bound * (2.0 * REACH + 0.6), "{sum}, {bound}");
                }
            }
        }
    }
}
