//! Motions that the evaluation makes itself: what the built-in one lacks, each with truth for every joint.

use glam::{EulerRot, Quat, Vec3};
use spmm3::{Avatar, Joint, LEGS, MotionClip, MotionParams, at_ease, bend_leg};
use std::f32::consts::TAU;

/// Frames a second of all of them.
const RATE: f32 = 30.0;

/// A motion by its time in seconds.
type At = fn(&Avatar, f32) -> MotionParams;

/// Names and motions.
const MOTIONS: [(&str, At); 4] = [
    ("fingers", fingers),
    ("squat", squat),
    ("turn", turn),
    ("face", face),
];

/// All of them, `seconds` long.
pub(super) fn made(avatar: &Avatar, seconds: f64) -> Vec<MotionClip> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some seconds of frames"
    )]
    let count = (seconds * f64::from(RATE)).round().max(1.0) as u16;
    let clip = |(name, at): (&str, At)| MotionClip {
        name: name.to_owned(),
        frames: (0..count)
            .map(|k| at(avatar, f32::from(k) / RATE))
            .collect(),
        frame_seconds: f64::from(RATE).recip(),
        notes: Vec::new(),
        unmapped: Vec::new(),
        expression_basis: None,
    };
    MOTIONS.into_iter().map(clip).collect()
}

/// From 0 to 1 and back, `hz` times a second.
fn wave(time: f32, hz: f32, phase: f32) -> f32 {
    0.5 - 0.5 * (TAU * (hz * time + phase)).cos()
}

/// Both hands before the chest, palms to the camera; fingers close one after the other, and together.
fn fingers(avatar: &Avatar, time: f32) -> MotionParams {
    let mut motion = at_ease(&avatar.skeleton);
    for (side, [shoulder, elbow, wrist]) in [
        (
            1.0,
            [Joint::LeftShoulder, Joint::LeftElbow, Joint::LeftWrist],
        ),
        (
            -1.0,
            [Joint::RightShoulder, Joint::RightElbow, Joint::RightWrist],
        ),
    ] {
        let turn = |x: f32, y: f32, z: f32| {
            Quat::from_euler(
                EulerRot::XYZ,
                x.to_radians(),
                side * y.to_radians(),
                side * z.to_radians(),
            )
        };
        motion.set_rotation(shoulder, turn(0.0, -20.0, -62.0));
        // The forearm up: an elbow bends about its -y at rest, and the upper arm's twist lifts it.
        motion.set_rotation(elbow, turn(0.0, -10.0, 118.0));
        motion.set_rotation(wrist, turn(-70.0 - 15.0 * wave(time, 0.4, 0.0), 0.0, 0.0));
    }
    // Index, middle, little, ring, thumb of the left hand, then of the right, three joints each.
    let hands = Joint::ALL.into_iter().skip(Joint::LeftIndex1.index());
    for (k, joint) in hands.enumerate() {
        let (hand, finger) = (k / 15, (k % 15) / 3);
        let side = if hand == 0 { 1.0 } else { -1.0 };
        let curl = wave(time, 0.5, 0.17 * finger as f32 + 0.31 * hand as f32);
        let rotation = if finger == 4 {
            Quat::from_rotation_y(side * (-25.0 * curl).to_radians())
        } else {
            // The hands lie along x at rest, palms down: a finger bends about z.
            Quat::from_rotation_z(side * (-70.0 * curl).to_radians())
        };
        motion.set_rotation(joint, rotation);
    }
    motion
}

/// Down and up, the feet where they stand, the arms raised to the front and to the sides.
fn squat(avatar: &Avatar, time: f32) -> MotionParams {
    let skeleton = &avatar.skeleton;
    let mut motion = at_ease(skeleton);
    let down = wave(time, 0.4, 0.0);
    let rest = skeleton.rest_positions();
    let lean = Quat::from_rotation_x((28.0 * down).to_radians());
    let shift = Vec3::new(0.0, -0.34 * down, -0.12 * down);
    motion.set_rotation(Joint::Pelvis, lean);
    motion.root_translation = shift;
    for leg in LEGS {
        let ankle = (rest[leg[2].index()], Quat::IDENTITY);
        let pelvis = (rest[Joint::Pelvis.index()] + shift, lean);
        bend_leg(&mut motion, skeleton, leg, pelvis, ankle, Vec3::Z);
    }
    let raise = wave(time, 0.4, 0.0);
    let out = wave(time, 0.2, 0.0);
    for (side, shoulder) in [(1.0, Joint::LeftShoulder), (-1.0, Joint::RightShoulder)] {
        let to_front = Quat::from_rotation_y(-side * (80.0 * raise * (1.0 - out)).to_radians());
        let lower = Quat::from_rotation_z(-side * (70.0 * (1.0 - raise)).to_radians());
        motion.set_rotation(shoulder, to_front * lower);
    }
    motion
}

/// On the spot to the left and to the right, so far that the back is half seen; the arms swing.
fn turn(avatar: &Avatar, time: f32) -> MotionParams {
    let mut motion = at_ease(&avatar.skeleton);
    let angle = 100.0 * (TAU * 0.2 * time).sin();
    motion.set_rotation(Joint::Pelvis, Quat::from_rotation_y(angle.to_radians()));
    for (side, shoulder) in [(1.0, Joint::LeftShoulder), (-1.0, Joint::RightShoulder)] {
        let swing = 35.0 * (TAU * 0.6 * time).sin() * side;
        let hanging = motion.rotation(shoulder);
        motion.set_rotation(
            shoulder,
            Quat::from_rotation_x(swing.to_radians()) * hanging,
        );
    }
    motion
}

/// The named expressions one after the other, and the head about its three axes.
fn face(avatar: &Avatar, time: f32) -> MotionParams {
    const SECONDS_EACH: f32 = 0.5;
    let mut motion = at_ease(&avatar.skeleton);
    let head = Quat::from_euler(
        EulerRot::YXZ,
        (22.0 * (TAU * 0.23 * time).sin()).to_radians(),
        (12.0 * (TAU * 0.31 * time).sin()).to_radians(),
        (8.0 * (TAU * 0.17 * time).sin()).to_radians(),
    );
    motion.set_rotation(Joint::Head, head);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some seconds"
    )]
    let number = (time / SECONDS_EACH) as usize % avatar.expressions.len().max(1);
    if let Some(preset) = avatar.expressions.values().nth(number) {
        let strength = wave(time, 1.0 / SECONDS_EACH, 0.0);
        for (to, from) in motion.expression_mut().iter_mut().zip(preset.coefficients) {
            *to = strength * from;
        }
        motion.set_axis_angle(Joint::Jaw, Vec3::X * (strength * preset.jaw));
    }
    motion
}
