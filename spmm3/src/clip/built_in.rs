//! The built-in performance: the motion of `score` applied to this skeleton and this face.
//!
//! Arm conventions, for the left arm (the right is its mirror image), all in the T-pose's axes: with the arm along +x and
//! the palm down, lowering it turns the shoulder about -z, raising it forward from hanging about -x, turning it inward
//! about +x (its own length); the elbow bends about -y; the palm turns up about -x (half in the forearm, half in the
//! wrist); the wrist bends back and the fingers open about the hand's own curl axis.

pub use super::score::LOOP_SECONDS;
use super::{MAX_FRAMES, MotionClip, MotionError, hands, narrow, score, stance};
use crate::{EXPRESSION, Expressions, Joint, MotionParams, Skeleton};
use glam::{Quat, Vec3};
use std::f64::consts::TAU;

/// Half widths of a syllable and of a blink, seconds.
const SYLLABLE: f64 = 0.15;
const BLINK: f64 = 0.11;
/// Jaw opening of each vowel, radians, for a face without presets.
const BARE_JAW: [(&str, f32); 5] = [
    ("a", 0.2),
    ("e", 0.1),
    ("i", 0.05),
    ("o", 0.13),
    ("u", 0.04),
];

/// Plays the score.
pub(super) fn perform(
    skeleton: &Skeleton,
    expressions: &Expressions,
    seconds: f64,
    frames_per_second: f64,
) -> Result<MotionClip, MotionError> {
    let count = (seconds * frames_per_second).round();
    if !(1.0..=MAX_FRAMES as f64).contains(&count) || frames_per_second <= 0.0 {
        return Err(MotionError::Request(format!(
            "a built-in motion of {seconds} s at {frames_per_second} frames per second has {count} frames; \
             1..={MAX_FRAMES} are possible"
        )));
    }
    let repeats = (seconds / LOOP_SECONDS).round().max(1.0);
    let frames = (0..super::floor_index(count))
        .map(|frame| {
            let time = frame as f64 / count * repeats * LOOP_SECONDS;
            one_frame(skeleton, expressions, time.rem_euclid(LOOP_SECONDS))
        })
        .collect();
    let mut notes = Vec::new();
    let missing: Vec<_> = ["blink", "smile", "brows_up", "brows_down"]
        .into_iter()
        .chain(["a", "e", "i", "o", "u", "mbp", "fv"])
        .filter(|name| !expressions.contains_key(*name))
        .collect();
    if !missing.is_empty() {
        notes.push(format!(
            "expressions this face does not have: {}",
            missing.join(", ")
        ));
    }
    Ok(MotionClip {
        name: "built-in".to_owned(),
        frames,
        frame_seconds: seconds / count,
        expression_basis: None,
        notes,
        unmapped: Vec::new(),
    })
}

/// A person standing still: at the origin, facing +z, soles flat on y = 0, arms hanging as in the built-in
/// performance, hands half open, neutral face.
#[must_use]
pub fn at_ease(skeleton: &Skeleton) -> MotionParams {
    let mut motion = MotionParams::default();
    stance::plant(&mut motion, skeleton, Vec3::ZERO, Quat::IDENTITY);
    for side in [0, 1] {
        place_arm(&mut motion, skeleton, side, score::HANG);
    }
    motion
}

fn one_frame(skeleton: &Skeleton, expressions: &Expressions, time: f64) -> MotionParams {
    let mut motion = MotionParams::default();
    body(&mut motion, skeleton, time);
    for side in [0, 1] {
        arm(&mut motion, skeleton, time, side);
    }
    face(&mut motion, expressions, time);
    motion
}

/// Hips, legs, spine, neck, head and eyes. The turn starts in the eyes, then the head, the chest, the hips.
fn body(motion: &mut MotionParams, skeleton: &Skeleton, time: f64) {
    let [shift, _, lean] = score::at(score::BODY, time);
    let shift = shift / 1000.0;
    let [_, hips_turn, _] = score::at(score::BODY, time - 0.12);
    let [_, chest_turn, _] = score::at(score::BODY, time);
    let sway = |rate: f64, phase: f64| narrow((TAU * (rate * time / LOOP_SECONDS + phase)).sin());
    let breath = sway(2.0, 0.1);
    // Weight over one leg lets the other hip drop.
    let roll = 1.1 * shift;
    let hips = Quat::from_rotation_y((0.42 * hips_turn).to_radians())
        * Quat::from_rotation_z(roll)
        * Quat::from_rotation_x((0.25 * lean).to_radians());
    let offset = Vec3::new(shift, -0.004, 0.004 * sway(1.0, 0.3) - 0.0004 * lean);
    stance::plant(motion, skeleton, offset, hips);
    let spine = [Joint::Spine1, Joint::Spine2, Joint::Spine3];
    for joint in spine {
        let pitch = (0.25 * lean).to_radians()
            + 0.006 * breath * if joint == Joint::Spine3 { -1.0 } else { 0.4 };
        let turn = (0.58 * chest_turn / 3.0 + 0.42 * (chest_turn - hips_turn) / 3.0).to_radians();
        motion.set_rotation(
            joint,
            Quat::from_rotation_y(turn)
                * Quat::from_rotation_z(-roll / 3.0)
                * Quat::from_rotation_x(pitch),
        );
    }
    for (joint, lift) in [(Joint::LeftCollar, 1.0), (Joint::RightCollar, -1.0)] {
        motion.set_rotation(joint, Quat::from_rotation_z(lift * (0.012 * breath - 0.02)));
    }
    // The head goes 0.75 of the way to where the eyes look, later and slower; the eyes do the rest at once.
    let [gaze, up] = score::at(score::GAZE, time);
    let [late_a, late_up_a] = score::at(score::GAZE, time - 0.1);
    let [late_b, late_up_b] = score::at(score::GAZE, time - 0.28);
    let [nod, tilt] = score::at(score::HEAD, time);
    let head_turn = 0.75 * 0.5 * (late_a + late_b);
    let head_up = 0.6 * 0.5 * (late_up_a + late_up_b);
    let neck_turn = head_turn - chest_turn;
    let pitch = nod - head_up - 0.75 * lean + 0.6 * sway(3.0, 0.2);
    for (joint, share) in [(Joint::Neck, 0.45), (Joint::Head, 0.55)] {
        motion.set_rotation(
            joint,
            Quat::from_rotation_y((share * (neck_turn + 0.8 * sway(2.0, 0.6))).to_radians())
                * Quat::from_rotation_z((-share * tilt).to_radians())
                * Quat::from_rotation_x((share * pitch).to_radians()),
        );
    }
    let eye_turn = (gaze - head_turn).clamp(-28.0, 28.0);
    let eye_pitch = (-up + head_up - 0.7 * nod).clamp(-20.0, 20.0);
    for eye in [Joint::LeftEye, Joint::RightEye] {
        motion.set_rotation(
            eye,
            Quat::from_rotation_y(eye_turn.to_radians())
                * Quat::from_rotation_x(eye_pitch.to_radians()),
        );
    }
}

/// One arm with its hand. The elbow follows the shoulder late, the wrist and the fingers later.
fn arm(motion: &mut MotionParams, skeleton: &Skeleton, time: f64, side: usize) {
    let track = [score::LEFT_ARM, score::RIGHT_ARM][side];
    let [forward, sideways, inward, ..] = score::at(track, time);
    let [_, _, _, elbow, palm_up, ..] = score::at(track, time - 0.05);
    let [_, _, _, _, _, back, ..] = score::at(track, time - 0.10);
    let [_, _, _, _, _, _, curl, pinch] = score::at(track, time - 0.13);
    let phase = if side == 0 { 0.0 } else { 0.37 };
    let drift = narrow((TAU * (2.0 * time / LOOP_SECONDS + phase)).sin());
    let arm = [
        forward + 0.8 * drift,
        sideways,
        inward,
        elbow + 1.2 * drift,
        palm_up,
        back + drift,
        curl + 0.02 * drift,
        pinch,
    ];
    place_arm(motion, skeleton, side, arm);
}

/// Poses one arm with its hand, in the score's angles.
fn place_arm(motion: &mut MotionParams, skeleton: &Skeleton, side: usize, arm: score::Arm) {
    let [forward, sideways, inward, elbow, palm_up, back, curl, pinch] = arm;
    let joints = [
        [Joint::LeftShoulder, Joint::LeftElbow, Joint::LeftWrist],
        [Joint::RightShoulder, Joint::RightElbow, Joint::RightWrist],
    ][side];
    let mirror = |q: Quat| {
        if side == 0 {
            q
        } else {
            Quat::from_xyzw(q.x, -q.y, -q.z, q.w)
        }
    };
    let shoulder = Quat::from_rotation_x(-forward.to_radians())
        * Quat::from_rotation_z((sideways - 90.0).to_radians())
        * Quat::from_rotation_x(inward.to_radians());
    let half_turn = Quat::from_rotation_x((-0.5 * palm_up).to_radians());
    let elbow = Quat::from_rotation_y(-elbow.to_radians()) * half_turn;
    motion.set_rotation(joints[0], mirror(shoulder));
    motion.set_rotation(joints[1], mirror(elbow));
    let axis = hands::curl_axis(skeleton, side);
    let bend = Quat::from_axis_angle(axis, -back.to_radians());
    motion.set_rotation(joints[2], mirror(half_turn) * bend);
    hand(motion, axis, side, curl, pinch);
}

fn hand(motion: &mut MotionParams, axis: Vec3, side: usize, curl: f32, pinch: f32) {
    let [index, middle, pinky, ring, thumb] =
        std::array::from_fn(|finger| hands::FINGERS[side * 5 + finger]);
    // The little finger closes first; in a pinch the index meets the thumb and the others open.
    let fingers = [
        (index, 0.85 * (1.0 - pinch) + 1.25 * pinch),
        (middle, 1.0 - 0.35 * pinch),
        (ring, 1.1 - 0.6 * pinch),
        (pinky, 1.2 - 0.8 * pinch),
    ];
    for (joints, share) in fingers {
        for (joint, degrees) in joints.into_iter().zip([52.0f32, 62.0, 40.0]) {
            motion.set_axis_angle(joint, axis * (share * curl * degrees).to_radians());
        }
    }
    // The thumb folds across the palm: about the forearm's length, and a little about the curl axis.
    let fold = if side == 0 { -Vec3::Y } else { Vec3::Y };
    let amount = 0.12 + 0.2 * curl + 0.25 * pinch;
    motion.set_axis_angle(thumb[0], (axis * 0.6 - fold * 0.3) * amount);
    motion.set_axis_angle(thumb[1], (axis * 0.5 - fold * 0.6) * amount);
    motion.set_axis_angle(thumb[2], (axis * 0.4 - fold * 0.8) * amount);
}

/// Expression coefficients and jaw from the avatar's presets.
fn face(motion: &mut MotionParams, expressions: &Expressions, time: f64) {
    let [smile, brows_up, brows_down] = score::at(score::FACE, time);
    let blink = score::BLINKS
        .iter()
        .map(|centre| score::bump(time, *centre, BLINK))
        .fold(0.0, f32::max);
    let mut mouth: Vec<(&str, f32)> = Vec::new();
    for (centre, viseme, strength) in score::SPEECH {
        let weight = strength * score::bump(time, *centre, SYLLABLE);
        if weight > 0.0 {
            mouth.push((viseme, weight));
        }
    }
    let total: f32 = mouth.iter().map(|(_, weight)| weight).sum();
    let limit = 1.0 / total.max(1.0);
    // A speaking mouth leaves less room to smile.
    let smile = smile * (1.0 - 0.45 * total.min(1.0));
    let steady = [
        ("smile", smile),
        ("brows_up", brows_up),
        ("brows_down", brows_down),
        ("blink", blink),
    ];
    let mut coefficients = [0.0f32; EXPRESSION];
    let mut jaw = 0.0f32;
    let spoken = mouth
        .into_iter()
        .map(|(name, weight)| (name, weight * limit));
    for (name, weight) in steady.into_iter().chain(spoken) {
        if let Some(preset) = expressions.get(name) {
            for (sum, value) in coefficients.iter_mut().zip(preset.coefficients) {
                *sum += weight * value;
            }
            jaw += weight * preset.jaw;
        } else if let Some((_, opening)) = BARE_JAW.iter().find(|(vowel, _)| *vowel == name) {
            jaw += weight * opening;
        }
    }
    motion.expression_mut().copy_from_slice(&coefficients);
    motion.set_axis_angle(Joint::Jaw, Vec3::X * jaw);
}
