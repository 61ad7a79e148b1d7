//! Derivatives of a picture's loss by everything that is learnt, through the model and the splatter together, against central differences.
//!
//! Both are single precision, and splats are cut off where they are faint: so the differences are along whole gradients, over which single pixels do not
//! count, and agree to some percent: the derivatives do not know of splats that come over the cut-off. Each half is checked number by number, in f64, where it is.

use super::studio::{capture, motions, poses, puppet, stranger};
use crate::Trainer;
use crate::colour::NUMBERS;
use crate::options::{Options, Weights};
use crate::pictures::Pair;
use avatar_gradient::{CORRECTION, Derivatives, Parameters, PoseCorrection};
use capture::HeldOut;
use splat_gradient::View;
use splat_gradient::error::GradientError;
use splat_gradient::loss::{PerceptualLoss, Target};
use synthetic_person::Random;

const PAIR: Pair = Pair {
    camera: 1,
    frame: 2,
};
/// Share by which the loss changes over a difference, and the steps that are taken, by that one.
const CHANGE: f64 = 4e-4;
const STEPS: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
/// Greatest error, as a share.
const MOST: f64 = 0.1;

/// The mean square of two pictures' differences: a perceptual loss whose derivatives can be written down.
#[derive(Debug)]
struct Squares;

impl PerceptualLoss for Squares {
    fn size(&self) -> [usize; 2] {
        [40, 110]
    }

    fn identity(&self) -> &'static str {
        "squares"
    }

    fn compare(
        &mut self,
        drawn: &[f32],
        wanted: &[f32],
        by_drawn: &mut [f32],
    ) -> Result<f64, GradientError> {
        let (mut sum, mean) = (0.0, 1.0 / drawn.len() as f32);
        for (by, (drawn, wanted)) in by_drawn.iter_mut().zip(drawn.iter().zip(wanted)) {
            let apart = drawn - wanted;
            sum += f64::from(mean * apart * apart);
            *by = 2.0 * mean * apart;
        }
        Ok(sum)
    }
}

fn loss(trainer: &mut Trainer<'_>, target: &Target, view: &View) -> f64 {
    trainer
        .compare(PAIR, true, target, view)
        .expect("compared")
        .loss
}

/// Demands that the loss changes along a gradient as the gradient's square says. `nudge` moves what is learnt by so much of the gradient.
fn assert_slope(
    kind: &str,
    trainer: &mut Trainer<'_>,
    (target, view): (&Target, &View),
    square: f64,
    nudge: impl Fn(&mut Trainer<'_>, f64),
) {
    let whole = loss(trainer, target, view);
    assert!(square > 0.0, "{kind}: no derivative");
    let mut difference = |step: f64| {
        nudge(trainer, step);
        let above = loss(trainer, target, view);
        nudge(trainer, -2.0 * step);
        let below = loss(trainer, target, view);
        nudge(trainer, step);
        (above - below) / (2.0 * step)
    };
    // Richardson's extrapolation: along layers that hardly matter yet, steps that can be told from rounding are long ones. Where splats come
    // over the cut-off depends on the step: the middle of five steps' slopes is hardly moved by that.
    let mut slopes = STEPS.map(|share| {
        let step = share * CHANGE * whole / square;
        (4.0 * difference(0.5 * step) - difference(step)) / 3.0
    });
    slopes.sort_by(f64::total_cmp);
    let found = slopes[STEPS.len() / 2];
    println!("{kind}: {found:.4e} by differences, {square:.4e} by derivatives");
    let off = (found / square - 1.0).abs();
    assert!(off < MOST, "{kind}: off by {:.1} %", 100.0 * off);
}

fn square(numbers: &[f32]) -> f64 {
    numbers.iter().map(|x| f64::from(*x).powi(2)).sum()
}

#[expect(clippy::cast_possible_truncation, reason = "single precision")]
fn add(numbers: &mut [f32], gradient: &[f32], step: f64) {
    for (number, by) in numbers.iter_mut().zip(gradient) {
        *number += (step * f64::from(*by)) as f32;
    }
}

/// Of the picture's loss, by all parameters, by the frame's pose and by the camera's colours.
fn derivatives(
    trainer: &mut Trainer<'_>,
    target: &Target,
    view: &View,
) -> (Parameters, PoseCorrection, Option<[f32; NUMBERS]>) {
    let compared = trainer.compare(PAIR, true, target, view).expect("compared");
    let mut gradients = Parameters::zeros(trainer.model.sizes());
    let by = Derivatives {
        gaussians: Some(&trainer.memory.by_gaussians),
        offsets: None,
        vertices: None,
    };
    let posed = &mut trainer.memory.posed;
    let by_pose = (trainer.model)
        .backward(&trainer.parameters, posed, &by, &mut gradients)
        .expect("derivatives");
    (gradients, by_pose, compared.by_colours)
}

#[test]
fn the_pictures_loss_falls_as_its_derivatives_say_by_everything_that_is_learnt() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let capture = capture(folder.path(), &truth, 2, &motions(3), &HeldOut::default());
    let first = stranger(&truth);
    let frames = poses(&capture, &first);
    let options = Options {
        colour_correction: true,
        weights: Weights {
            bind: 0.0,
            scale: 0.0,
            guide: 0.0,
            // So large that most of the loss is its own.
            lpips: 0.75,
            ..Weights::default()
        },
        ..Options::default()
    };
    let mut trainer = Trainer::new(&capture, first, frames, options).expect("a training");
    trainer.judge_with(Box::new(Squares)).expect("at the start");
    // Away from where F_attr is silent and colours are as they are, to a step that takes the perceptual loss.
    for step in 0..42u8 {
        trainer.step(0.4 + f32::from(step) / 400.0).expect("a step");
    }
    let mut random = Random::new(3);
    for number in &mut trainer.parameters.bases {
        *number += 2e-3 * random.signed();
    }
    for number in &mut trainer.colours[PAIR.camera].numbers {
        *number += 0.05 * random.signed();
    }
    let cut = trainer.pictures.cut(PAIR).expect("a picture");
    let target = cut.target(0).expect("a picture");
    let view = cut
        .view(&capture.cameras()[PAIR.camera], 0)
        .expect("a camera");
    let (gradients, by_pose, by_colours) = derivatives(&mut trainer, &target, &view);
    let seen = (&target, &view);
    for (at, (name, gradient)) in gradients.arrays().into_iter().enumerate() {
        assert_slope(
            name,
            &mut trainer,
            seen,
            square(gradient),
            |trainer, step| {
                let (_, array) = trainer
                    .parameters
                    .arrays_mut()
                    .into_iter()
                    .nth(at)
                    .expect("an array");
                add(array, gradient, step);
            },
        );
    }
    let count = trainer.gaussians();
    for (name, planes) in [
        ("offsets", 0..3),
        ("rotations", 3..7),
        ("scales", 7..10),
        ("opacities", 10..11),
        ("colours", 11..14),
    ] {
        let range = planes.start * count..planes.end * count;
        let gradient = &gradients.gaussians[range.clone()];
        assert_slope(
            name,
            &mut trainer,
            seen,
            square(gradient),
            |trainer, step| {
                add(
                    &mut trainer.parameters.gaussians[range.clone()],
                    gradient,
                    step,
                );
            },
        );
    }
    let turns = &by_pose.0[..CORRECTION - 3];
    assert_slope(
        "turns",
        &mut trainer,
        seen,
        square(turns),
        |trainer, step| {
            add(&mut trainer.poses[PAIR.frame].correction.0, turns, step);
        },
    );
    let gradient = by_colours.expect("colours are corrected");
    assert_slope(
        "camera's colours",
        &mut trainer,
        seen,
        square(&gradient),
        |trainer, step| {
            add(&mut trainer.colours[PAIR.camera].numbers, &gradient, step);
        },
    );
    // Beside where the person stands: there, what pulls one way and the other does not cancel.
    let shift = CORRECTION - 3;
    add(
        &mut trainer.poses[PAIR.frame].correction.0[shift..],
        &[0.03, -0.02, 0.04],
        1.0,
    );
    let (_, by_pose, _) = derivatives(&mut trainer, &target, &view);
    let by_shift = &by_pose.0[shift..];
    assert_slope(
        "shift",
        &mut trainer,
        seen,
        square(by_shift),
        |trainer, step| {
            let correction = &mut trainer.poses[PAIR.frame].correction.0;
            add(&mut correction[shift..], by_shift, step);
        },
    );
}
