//! Adam for every kind of parameter, each at its rate.

use crate::error::TrainError;
use crate::schedule::{FIRST, Rates};
use avatar_gradient::{CORRECTION, Parameters, PoseCorrection};
use splat_gradient::adam::{Adam, Group};
use spmm3::{ATTRIBUTES, BODY, EXPRESSION, HANDS, Joint, MotionParams, attribute};

/// The name of the bases among the arrays of [`Parameters`]: their derivatives are never stored.
pub(super) const BASES: &str = "bases";
/// The name of the template Gaussians' array.
pub(super) const GAUSSIANS: &str = "gaussians";

/// Fingers are seen by few pixels: they learn by this share of the other joints' rate.
const FINGERS: f32 = 0.3;

/// A decimetre weighs as much as a radian.
const DECIMETRES: f32 = 10.0;
/// The pull towards the capture's poses is by a correction's length, not its square: a small one, which pictures hardly ask for, is pulled as much as a
/// large one. Below about this, radians, it eases off.
const CORNER: f32 = 1e-3;

/// What Adam remembers of all parameters but poses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Optimiser {
    /// One for each array of [`Parameters`], in their order; that of the bases is empty.
    pub(super) arrays: Vec<Adam>,
    pub(super) bases: Adam,
}

impl Optimiser {
    pub(super) fn new(parameters: &Parameters) -> Self {
        let arrays = parameters
            .arrays()
            .map(|(name, array)| Adam::new(if name == BASES { 0 } else { array.len() }));
        Self {
            arrays: arrays.into(),
            bases: Adam::new(parameters.bases.len()),
        }
    }

    /// Steps all arrays but the bases.
    pub(super) fn step(
        &mut self,
        parameters: &mut Parameters,
        gradients: &Parameters,
        rates: &Rates,
    ) -> Result<(), TrainError> {
        let arrays = parameters.arrays_mut().into_iter().zip(gradients.arrays());
        for (((name, numbers), (_, gradients)), adam) in arrays.zip(&mut self.arrays) {
            let count = numbers.len();
            let rate = match name {
                BASES => continue,
                GAUSSIANS => {
                    let each = count / ATTRIBUTES;
                    let groups = planes(rates).map(|rate| Group { count: each, rate });
                    if groups.iter().any(|group| group.rate > 0.0) {
                        adam.step(numbers, gradients, &groups)?;
                    }
                    continue;
                }
                "mesh.mean" => rates.mesh_mean,
                "mesh.fields" => rates.mesh_fields,
                name if name.starts_with("mesh.") => rates.mesh_layers,
                _ => rates.controllers,
            };
            // What does not learn has no time either: its moments would be corrected for steps that they did not see.
            if rate > 0.0 {
                adam.step(numbers, gradients, &[Group { count, rate }])?;
            }
        }
        Ok(())
    }
}

/// The rate of each attribute plane of the template's Gaussians.
pub(super) fn planes(rates: &Rates) -> [f32; ATTRIBUTES] {
    std::array::from_fn(|plane| match plane {
        p if attribute::OFFSET.contains(&p) => rates.offset,
        p if attribute::ROTATION.contains(&p) => rates.rotation,
        p if attribute::LOG_SCALE.contains(&p) => rates.log_scale,
        attribute::OPACITY => rates.opacity,
        _ => rates.colour,
    })
}

/// The rate of each attribute plane of the bases.
pub(super) fn basis_planes(rates: &Rates) -> [f32; ATTRIBUTES] {
    planes(&FIRST).map(|rate| rate * rates.bases)
}

/// One frame's correction, and what Adam remembers of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FramePose {
    pub(super) correction: PoseCorrection,
    pub(super) adam: Adam,
}

impl Default for FramePose {
    fn default() -> Self {
        Self {
            correction: PoseCorrection::default(),
            adam: Adam::new(CORRECTION),
        }
    }
}

impl FramePose {
    /// Makes a step down the picture's derivatives and `pull` times each joint's turn and the shift. The face keeps the capture's coefficients: what pictures say of it goes into the avatar.
    pub(super) fn step(
        &mut self,
        by_pose: &PoseCorrection,
        pull: f32,
        rates: &Rates,
    ) -> Result<(), TrainError> {
        if rates.pose <= 0.0 && rates.shift <= 0.0 {
            return Ok(());
        }
        let mut gradient = by_pose.0;
        let turns = Joint::ALL.map(|joint| (MotionParams::offset_of(joint), 1.0));
        for (first, unit) in turns.into_iter().chain([(CORRECTION - 3, DECIMETRES)]) {
            let part = first..first + 3;
            let numbers = &self.correction.0[part.clone()];
            let square: f32 = numbers.iter().map(|x| (unit * x).powi(2)).sum();
            let pull = pull * unit * unit / (square + CORNER * CORNER).sqrt();
            for (gradient, number) in gradient[part].iter_mut().zip(numbers) {
                *gradient += pull * number;
            }
        }
        let groups = [
            (BODY, rates.pose),
            (EXPRESSION, 0.0),
            (HANDS, FINGERS * rates.pose),
            (3, rates.shift),
        ]
        .map(|(count, rate)| Group { count, rate });
        self.adam.step(&mut self.correction.0, &gradient, &groups)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pull_towards_the_captures_pose_is_that_of_finite_differences() {
        let mut pose = FramePose::default();
        for (at, number) in (0u8..).zip(&mut pose.correction.0) {
            *number = 0.0002 * f32::from(at % 31) - 0.003;
        }
        pose.correction.0[BODY..BODY + EXPRESSION].fill(0.0);
        let before = pose.correction.0.map(f64::from);
        // By radians and decimetres; the face, which lies between body and hands, has none.
        let pull = |numbers: &[f64; CORRECTION]| -> f64 {
            let (turns, shift) = numbers.split_at(CORRECTION - 3);
            let (body, rest) = turns.split_at(BODY);
            let lengths = |all: &[f64], unit: f64| -> f64 {
                let squares = all.chunks(3).map(|one| {
                    let square: f64 = one.iter().map(|x| (unit * x).powi(2)).sum();
                    (square + 1e-6).sqrt()
                });
                squares.sum()
            };
            let turns = lengths(body, 1.0) + lengths(&rest[EXPRESSION..], 1.0);
            0.25 * (turns + lengths(shift, 10.0))
        };
        let rates = Rates {
            pose: 1e-3,
            shift: 1e-3,
            ..Rates::default()
        };
        let none = PoseCorrection::default();
        pose.step(&none, 0.25, &rates).expect("as many");
        for at in [
            0,
            40,
            BODY + EXPRESSION,
            CORRECTION - 4,
            CORRECTION - 3,
            CORRECTION - 1,
        ] {
            let moved = |sign: f64| {
                let mut moved = before;
                moved[at] += sign * 1e-5;
                pull(&moved)
            };
            let expected = (moved(1.0) - moved(-1.0)) / 2e-5;
            // Adam's first mean after one step: a tenth of the derivative.
            let got = 10.0 * f64::from(pose.adam.first[at]);
            assert!((got - expected).abs() < 1e-4, "{at}: {got}, {expected}");
        }
    }

    #[test]
    fn the_face_keeps_the_captures_coefficients() {
        let mut pose = FramePose::default();
        let rates = Rates {
            pose: 0.1,
            shift: 0.2,
            ..Rates::default()
        };
        pose.step(&PoseCorrection([1.0; CORRECTION]), 0.0, &rates)
            .expect("as many");
        let correction = &pose.correction;
        assert!((correction.0[0] + 0.1).abs() < 1e-5, "body");
        assert!(correction.0[BODY].abs() < 1e-9, "face");
        assert!(
            (correction.0[BODY + EXPRESSION] + 0.03).abs() < 1e-5,
            "hands"
        );
        assert!((correction.shift().x + 0.2).abs() < 1e-5, "root");
    }
}
