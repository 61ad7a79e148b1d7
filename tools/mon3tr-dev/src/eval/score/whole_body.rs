//! Figures of what renders know besides the limbs: pelvis, feet, fingers and face.

use super::{LIMBS, Posed};
use glam::{DQuat, DVec3};
use serde::Serialize;
use spmm3::EXPRESSION;

/// Finger joints of both hands.
pub(in crate::eval) const FINGERS: usize = 30;

/// The left ankle in [`LIMBS`]; the right one follows.
pub(super) const ANKLES: usize = 4;
/// A foot is in stance while its joint moves slower than this in truth, metres a second.
const STANCE: f64 = 0.1;

/// A body beyond its limbs' joints, in one frame.
#[derive(Debug, Clone)]
pub(in crate::eval) struct WholeBody {
    /// The feet's joints, left and right, in the room, metres.
    pub(in crate::eval) feet: [DVec3; 2],
    /// The pelvis in camera axes.
    pub(in crate::eval) pelvis: DQuat,
    /// Each finger joint relative to its parent, left hand first.
    pub(in crate::eval) fingers: [DQuat; FINGERS],
    /// Opening of the jaw, radians.
    pub(in crate::eval) jaw: f64,
    /// Expression coefficients.
    pub(in crate::eval) expression: [f64; EXPRESSION],
}

/// The figures of one motion.
#[derive(Debug, Clone, Serialize)]
pub(in crate::eval) struct WholeBodyScores {
    /// Angle between the pelvis and its truth, degrees.
    pub(in crate::eval) pelvis_degrees: f64,
    /// Mean angle of a finger joint from its truth, degrees: left, right.
    pub(in crate::eval) finger_degrees: [f64; 2],
    /// Correlation of a hand's curl (the sum of its flexions, thumb left out) with truth while the wrist is in the picture; none where truth
    /// hardly moves.
    pub(in crate::eval) curl_correlation: [Option<f64>; 2],
    /// Mean correlation of those expression coefficients that move in truth, and that of the jaw's opening.
    pub(in crate::eval) expression_correlation: Option<f64>,
    pub(in crate::eval) jaw_correlation: Option<f64>,
    /// Mean speed of a foot while it stands in truth, metres a second; none where no foot stands.
    pub(in crate::eval) foot_slide: Option<f64>,
    /// The same of the frames in which that foot's ankle is in the picture.
    pub(in crate::eval) foot_slide_seen: Option<f64>,
}

/// A frame of which truth and tracked body are known whole.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known<'a> {
    frame: usize,
    seen: [bool; LIMBS.len()],
    truth: &'a WholeBody,
    tracked: &'a WholeBody,
}

impl<'a> Known<'a> {
    /// Of a frame's number, its truth and what was tracked.
    pub(super) fn of(&(frame, truth, tracked): &(usize, &'a Posed, &'a Posed)) -> Option<Self> {
        Some(Self {
            frame,
            seen: truth.seen,
            truth: truth.whole_body.as_ref()?,
            tracked: tracked.whole_body.as_ref()?,
        })
    }
}

impl WholeBodyScores {
    /// Compares tracked bodies with true ones; none without any.
    pub(super) fn of(known: &[Known<'_>], rate_hz: f64) -> Option<Self> {
        if known.is_empty() {
            return None;
        }
        let mean =
            |of: &dyn Fn(&Known<'_>) -> f64| known.iter().map(of).sum::<f64>() / known.len() as f64;
        let half = FINGERS / 2;
        let finger_degrees = [0, half].map(|first| {
            mean(&|known| {
                let pairs = (known.tracked.fingers.iter().zip(&known.truth.fingers)).skip(first);
                let angles = pairs.take(half).map(|(a, b)| angle(*a, *b));
                angles.sum::<f64>() / half as f64
            })
        });
        let [foot_slide, foot_slide_seen] = foot_slide(known, rate_hz);
        let curl_correlation = [0, 1].map(|hand| {
            // A hand that is out of the picture says nothing of the fit.
            let wrist = LIMBS.len() - 2 + hand;
            let shown: Vec<_> = (known.iter().filter(|known| known.seen[wrist]))
                .copied()
                .collect();
            correlate(&shown, 0.05, |body| curl(body, hand))
        });
        let moving: Vec<f64> = (0..EXPRESSION)
            .filter_map(|k| correlate(known, 0.05, |body| body.expression[k]))
            .collect();
        Some(Self {
            pelvis_degrees: mean(&|known| angle(known.tracked.pelvis, known.truth.pelvis)),
            finger_degrees,
            curl_correlation,
            expression_correlation: (!moving.is_empty())
                .then(|| moving.iter().sum::<f64>() / moving.len() as f64),
            jaw_correlation: correlate(known, 0.01, |body| body.jaw),
            foot_slide,
            foot_slide_seen,
        })
    }
}

/// Degrees between two rotations.
fn angle(a: DQuat, b: DQuat) -> f64 {
    a.angle_between(b).to_degrees()
}

/// Mean speed of tracked feet while they stand in truth: of all, and of those whose ankles are in the picture.
fn foot_slide(known: &[Known<'_>], rate_hz: f64) -> [Option<f64>; 2] {
    let mut sums = [(0.0, 0u32); 2];
    for window in known.windows(2) {
        let [a, b] = window else { continue };
        if b.frame != a.frame + 1 {
            continue;
        }
        for foot in 0..2 {
            let speed =
                |a: &WholeBody, b: &WholeBody| a.feet[foot].distance(b.feet[foot]) * rate_hz;
            if speed(a.truth, b.truth) >= STANCE {
                continue;
            }
            let seen = a.seen[ANKLES + foot] && b.seen[ANKLES + foot];
            for (sum, count) in &mut sums[..=usize::from(seen)] {
                *sum += speed(a.tracked, b.tracked);
                *count += 1;
            }
        }
    }
    sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)))
}

/// Sum of the flexions of a hand's four fingers, radians.
fn curl(body: &WholeBody, hand: usize) -> f64 {
    // Index, middle, little and ring finger; the thumb's joints are the last.
    let joints = &body.fingers[hand * FINGERS / 2..][..12];
    joints
        .iter()
        .map(|q| q.angle_between(DQuat::IDENTITY))
        .sum()
}

/// Pearson's correlation of `of` between tracked and true bodies; none where truth deviates by less than `least`.
fn correlate(known: &[Known<'_>], least: f64, of: impl Fn(&WholeBody) -> f64) -> Option<f64> {
    let count = known.len().max(1) as f64;
    let mean = |values: &dyn Fn(&Known<'_>) -> f64| known.iter().map(values).sum::<f64>() / count;
    let (tracked, truth) = (mean(&|k| of(k.tracked)), mean(&|k| of(k.truth)));
    let (mut both, mut a, mut b) = (0.0, 0.0, 0.0);
    for one in known {
        let (x, y) = (of(one.tracked) - tracked, of(one.truth) - truth);
        both += x * y;
        a += x * x;
        b += y * y;
    }
    let moves = (b / count).sqrt() >= least;
    moves.then(|| if a > 0.0 { both / (a * b).sqrt() } else { 0.0 })
}
