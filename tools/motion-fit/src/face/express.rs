//! Which of an avatar's named expressions, and how much of each, look like what was measured.
//!
//! The mouth's presets mix: their weights are the non-negative ones whose signatures add up best to the measured opening,
//! width, corners and lips. A preset that the avatar lacks is left out.

use super::FaceMeasures;
use glam::{DQuat, DVec3};
use spmm3::{EXPRESSION, Expressions};

/// What a measured face sets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePose {
    /// Expression coefficients in the avatar's own basis.
    pub expression: [f32; EXPRESSION],
    /// Opening of the jaw joint about its x axis, radians.
    pub jaw: f64,
    /// Rotations of the left and right eye's joints relative to the head.
    pub eyes: [DQuat; 2],
}

/// What a mouth's preset does at full strength to opening, width, corners and lips' pressing, as [`FaceMeasures`] has them.
/// Measured on renders of the demo avatar with MediaPipe's face mesh, but for `mbp`: that mesh hardly sees its pressed lips.
const MOUTH: [(&str, [f64; 4]); 8] = [
    ("a", [0.47, 0.36, -0.49, -0.18]),
    ("e", [0.60, 0.76, 0.11, 0.40]),
    ("i", [0.50, 0.69, 0.24, 0.64]),
    ("o", [0.36, -0.64, -0.61, -0.54]),
    ("u", [0.39, -1.40, -0.69, -0.48]),
    ("mbp", [-0.04, 0.25, 0.25, 0.75]),
    ("fv", [0.22, 0.06, 0.41, -0.01]),
    ("smile", [0.17, 0.84, 1.00, 0.24]),
];
/// Deviations of the four measures that noise and people's differences make.
const NOISE: [f64; 4] = [0.06, 0.15, 0.15, 0.12];
/// A yaw or pitch (radians) at which width and corners are twice as uncertain.
const TURNED: f64 = 0.4;
/// Opening of the mouth at which the lips' red is twice as uncertain, and from which on lips cannot be pressed.
const PARTED: f64 = 0.3;
/// Deviation of a weight before anything is seen.
const WEIGHT: f64 = 0.7;
/// How much more a brow counts on the side that the face shows, per sine of the head's yaw: the mesh guesses the other one.
const ASIDE: f64 = 0.8;
/// Greatest weights: the jaw's own preset may open twice as far.
const MOST: f64 = 1.1;
const MOST_OPEN: f64 = 2.0;
/// Opening of the jaw by `a` for an avatar without that preset, and the widest of all, radians.
const PLAIN_JAW: f64 = 0.19;
const MOST_JAW: f64 = 0.42;
/// Rounds of the solver over all weights.
const ROUNDS: usize = 60;

/// The avatar's expression that shows `face`, made of its named `presets`.
#[must_use]
pub fn apply(face: &FaceMeasures, presets: &Expressions) -> FacePose {
    let mut sum = [0.0f64; EXPRESSION];
    let mut jaw = 0.0;
    let mut add = |name: &str, weight: f64| {
        let Some(preset) = presets.get(name) else {
            return;
        };
        for (sum, value) in sum.iter_mut().zip(preset.coefficients) {
            *sum += weight * f64::from(value);
        }
        jaw += weight * f64::from(preset.jaw);
    };
    let weights = mouth(face, presets);
    for ((name, _), weight) in MOUTH.into_iter().zip(weights) {
        add(name, weight);
    }
    // One blink for both lids: half a blink of each looks asleep, so the more open eye decides unless one is quite shut.
    let [left, right] = face.blink;
    add("blink", left.min(right).max(left.max(right) * 2.0 - 1.0));
    // A head that looks to the picture's left shows its left side.
    let forward = face.camera_from_head * DVec3::Z;
    let left = (0.5 - ASIDE * forward.x).clamp(0.0, 1.0);
    let brows = face.brows[0] * left + face.brows[1] * (1.0 - left);
    add("brows_up", brows.max(0.0));
    add("brows_down", (-brows).max(0.0));
    if !presets.contains_key("a") {
        jaw += weights[0] * PLAIN_JAW;
    }
    // Positive turns about y look to the person's left, about x down.
    let eye = DQuat::from_axis_angle(DVec3::Y, face.gaze.x)
        * DQuat::from_axis_angle(DVec3::X, -face.gaze.y);
    #[allow(
        clippy::cast_possible_truncation,
        reason = "coefficients are single precision"
    )]
    let expression = sum.map(|value| value as f32);
    FacePose {
        expression,
        jaw: jaw.clamp(0.0, MOST_JAW),
        eyes: [eye; 2],
    }
}

/// Weights of [`MOUTH`]'s presets: ridge regression with bounds by coordinate descent, which is convex and so ends at the only
/// best weights.
fn mouth(face: &FaceMeasures, presets: &Expressions) -> [f64; MOUTH.len()] {
    let forward = face.camera_from_head * DVec3::Z;
    let aside = forward.x.hypot(forward.y).min(1.0).asin() / TURNED;
    let doubt = 1.0 + aside * aside;
    let scale = [
        1.0 / NOISE[0],
        1.0 / (NOISE[1] * doubt),
        1.0 / (NOISE[2] * doubt),
        1.0 / (NOISE[3] * (1.0 + face.mouth_open / PARTED)),
    ];
    let seen = [
        face.mouth_open,
        face.mouth_width,
        face.corners,
        face.lip_press,
    ];
    let mut rest: [f64; 4] = std::array::from_fn(|k| seen[k] * scale[k]);
    let columns = MOUTH.map(|(name, signature)| {
        let there = name == "a" || presets.contains_key(name);
        let share = match name {
            "mbp" => (1.0 - face.mouth_open / PARTED).max(0.0),
            _ => 1.0,
        };
        let share = if there { share } else { 0.0 };
        let column: [f64; 4] = std::array::from_fn(|k| share * signature[k] * scale[k]);
        column
    });
    let mut weights = [0.0; MOUTH.len()];
    let prior = 1.0 / (WEIGHT * WEIGHT);
    for _ in 0..ROUNDS {
        for (k, column) in columns.iter().enumerate() {
            let square: f64 = column.iter().map(|v| v * v).sum();
            let slope: f64 = column.iter().zip(&rest).map(|(v, r)| v * r).sum();
            let most = if k == 0 { MOST_OPEN } else { MOST };
            let best = ((slope + square * weights[k]) / (square + prior)).clamp(0.0, most);
            let change = best - weights[k];
            for (rest, v) in rest.iter_mut().zip(column) {
                *rest -= change * v;
            }
            weights[k] = best;
        }
    }
    weights
}
