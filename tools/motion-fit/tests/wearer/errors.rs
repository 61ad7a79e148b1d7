//! How far a fit is from the truth.

use crate::common::{V3, add, angle, forward, mul, mul_v, norm, scale, sub, transpose};
use crate::truth::{HEAD, TURNED, Truth, WRISTS, rest};
use motion_fit::wearer::{Stance, WearerFit, WearerSample};
use spmm3::{MotionParams, Skeleton};

/// Distances of a fit from the truth, metres and radians.
#[derive(Default)]
pub(crate) struct Errors {
    pub(crate) head: Vec<f64>,
    pub(crate) head_turn: Vec<f64>,
    pub(crate) wrists: Vec<f64>,
    pub(crate) wrist_turns: Vec<f64>,
    pub(crate) elbows: Vec<f64>,
    pub(crate) hips: Vec<f64>,
    pub(crate) knees: Vec<f64>,
    pub(crate) ankles: Vec<f64>,
    pub(crate) lowest: f64,
    /// Of standing balls of the feet, m/s.
    pub(crate) slides: Vec<f64>,
}

pub(crate) fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

/// Balls and heels of the feet on the template's floor, in motion space.
fn soles(skeleton: &Skeleton, motion: &MotionParams) -> [V3; 4] {
    let (rotations, positions) = forward(skeleton, motion);
    [(7, 7, -0.05), (7, 10, 0.0), (8, 8, -0.05), (8, 11, 0.0)].map(|(ankle, under, back)| {
        let mut at = rest(skeleton, under);
        at[1] = 0.0;
        at[2] += back;
        add(
            positions[ankle],
            mul_v(&rotations[ankle], sub(at, rest(skeleton, ankle))),
        )
    })
}

/// Fits what `truth`'s wearer does in `motions`, `hz` a second. `change` is what the headset makes of each sample.
pub(crate) fn follow(
    truth: &Truth<'_>,
    motions: &[MotionParams],
    hz: f64,
    change: impl Fn(&mut WearerSample),
) -> Errors {
    let skeleton = truth.skeleton;
    let mut fit = WearerFit::new(skeleton, Stance::Standing);
    let mut errors = Errors::default();
    let mut before: Option<[V3; 4]> = None;
    for (number, motion) in motions.iter().enumerate() {
        let mut sample = truth.sample(number as f64 / hz, motion);
        change(&mut sample);
        let fitted = fit.step(&sample).expect("a head");
        let (true_turns, truly) = forward(skeleton, motion);
        let (turns, joints) = forward(skeleton, &fitted.motion);
        // By the fit's own account of where its metres are; compared in the wearer's.
        let floor = |at: V3| {
            let at = fit.floor_from_motion(glam::DVec3::from_array(at));
            at.expect("begun").to_array()
        };
        let apart = |a: V3, b: V3| norm(sub(floor(a), truth.floor(b)));
        errors
            .head
            .push(apart(truth.eyes(&fitted.motion), truth.eyes(motion)));
        // Both headings are relative to where the wearer began.
        let yaw = {
            let x = sub(floor([1.0, 0.0, 0.0]), floor([0.0; 3]));
            let z = sub(floor([0.0, 0.0, 1.0]), floor([0.0; 3]));
            let [x, z] = [x, z].map(|axis| scale(axis, 1.0 / norm(axis)));
            let columns = [x, [0.0, 1.0, 0.0], z];
            mul(&TURNED, &transpose(&columns))
        };
        let turned = |joint: usize| {
            angle(&mul(
                &transpose(&mul(&yaw, &turns[joint])),
                &true_turns[joint],
            ))
        };
        errors.head_turn.push(turned(HEAD));
        for wrist in WRISTS {
            errors.wrists.push(apart(joints[wrist], truly[wrist]));
            errors.wrist_turns.push(turned(wrist));
        }
        for elbow in [18, 19] {
            errors.elbows.push(apart(joints[elbow], truly[elbow]));
        }
        for [knee, ankle] in [[4, 7], [5, 8]] {
            errors.knees.push(apart(joints[knee], truly[knee]));
            errors.ankles.push(apart(joints[ankle], truly[ankle]));
        }
        errors.hips.push(apart(joints[0], truly[0]));
        let feet = soles(skeleton, &fitted.motion);
        for (k, foot) in feet.iter().enumerate() {
            errors.lowest = errors.lowest.min(foot[1]);
            if let Some(before) =
                before.filter(|before| k % 2 == 1 && foot[1].max(before[k][1]) < 0.01)
            {
                let mut slide = sub(*foot, before[k]);
                slide[1] = 0.0;
                errors.slides.push(norm(slide) * hz);
            }
        }
        before = Some(feet);
    }
    errors
}

pub(crate) fn print(name: &str, errors: &Errors) {
    let mm = |values: &[f64]| [0.5, 0.95, 1.0].map(|p| percentile(values, p) * 1e3);
    let degrees = |values: &[f64]| [0.5, 0.95, 1.0].map(|p| percentile(values, p).to_degrees());
    println!("{name}: median, 95th percentile, worst");
    println!(
        "  eyes {:.2?} mm, {:.2?} degrees",
        mm(&errors.head),
        degrees(&errors.head_turn)
    );
    println!(
        "  wrists {:.1?} mm, {:.1?} degrees",
        mm(&errors.wrists),
        degrees(&errors.wrist_turns)
    );
    println!(
        "  elbows {:.0?} mm, hips {:.0?} mm, knees {:.0?} mm, ankles {:.0?} mm",
        mm(&errors.elbows),
        mm(&errors.hips),
        mm(&errors.knees),
        mm(&errors.ankles)
    );
    println!(
        "  soles at lowest {:.1} mm, balls on the floor slide {:.0?} mm/s",
        errors.lowest * 1e3,
        mm(&errors.slides)
    );
}

pub(crate) fn check(errors: &Errors) {
    assert!(percentile(&errors.head, 1.0) < 0.01, "the head");
    assert!(percentile(&errors.head_turn, 1.0) < 0.05, "the look");
    assert!(percentile(&errors.wrists, 0.95) < 0.03, "the wrists");
    assert!(percentile(&errors.elbows, 0.5) < 0.12, "the elbows");
    assert!(errors.lowest > -0.03, "the floor");
}

/// Feet that are supposed stand still.
pub(crate) fn check_slides(errors: &Errors) {
    assert!(percentile(&errors.slides, 0.5) < 0.05, "sliding feet");
}
