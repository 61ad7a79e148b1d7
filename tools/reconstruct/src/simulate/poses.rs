//! Natural poses to train on: poses of people in front of a camera, sampled from correlated joint ranges.
//!
//! No capture file is needed. Each pose mixes a way to stand, an arm movement, the head, the hands and the face, all
//! with the variation a retargeted capture brings (twist split differently between joints, small tilts). The root
//! orientation stays zero: the networks never see it.

use fastrand::Rng;
use glam::{Quat, Vec3};
use spmm3::{EXPRESSION, Expressions, Joint, MotionParams};
use std::f32::consts::PI;

/// Left is +1: the arm lies along +x in T-pose. Right mirrors it.
const SIDES: [(f32, [Joint; 4], [Joint; 3], usize); 2] = [
    (
        1.0,
        [
            Joint::LeftCollar,
            Joint::LeftShoulder,
            Joint::LeftElbow,
            Joint::LeftWrist,
        ],
        [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle],
        Joint::LeftIndex1.index(),
    ),
    (
        -1.0,
        [
            Joint::RightCollar,
            Joint::RightShoulder,
            Joint::RightElbow,
            Joint::RightWrist,
        ],
        [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle],
        Joint::RightIndex1.index(),
    ),
];

/// Finger joints of one hand: four fingers, then the thumb.
const FINGER_JOINTS: usize = 15;

/// Draws poses, the same ones for the same seed on every machine.
#[derive(Debug, Clone)]
pub struct PoseSampler<'a> {
    rng: Rng,
    expressions: &'a Expressions,
    components: usize,
}

impl<'a> PoseSampler<'a> {
    /// `components` is how many expression slots the avatar fills, `expressions` its named faces.
    #[must_use]
    pub fn new(seed: u64, expressions: &'a Expressions, components: usize) -> Self {
        Self {
            rng: Rng::with_seed(seed),
            expressions,
            components: components.min(EXPRESSION),
        }
    }

    /// The next pose; the root stays upright at the origin.
    pub fn sample(&mut self) -> MotionParams {
        let mut pose = MotionParams::default();
        self.legs(&mut pose);
        self.torso(&mut pose);
        let action = self.rng.u8(0..10);
        for side in 0..2 {
            // Most things are done with both arms alike; the rest with each arm for itself.
            let own = if self.rng.u8(0..3) == 0 {
                self.rng.u8(0..10)
            } else {
                action
            };
            self.arm(&mut pose, side, own);
            self.hand(&mut pose, side);
        }
        self.face(&mut pose);
        self.vary(&mut pose);
        pose
    }

    /// Uniform in `low..high`.
    fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.rng.f32()
    }

    /// Roughly normal with the given deviation, bounded at three of them.
    fn around(&mut self, deviation: f32) -> f32 {
        let sum: f32 = (0..4).map(|_| self.rng.f32() - 0.5).sum();
        (sum * 1.73).clamp(-3.0, 3.0) * deviation
    }

    fn legs(&mut self, pose: &mut MotionParams) {
        let action = self.rng.u8(0..6);
        let phase = self.within(0.0, 2.0 * PI);
        let depth = self.rng.f32();
        for (sign, _, [hip, knee, ankle], _) in SIDES {
            // Flexion of hip and knee, and how far the thigh is spread sideways; radians.
            let (flex, bend, spread) = match action {
                0 => (0.0, 0.05, 0.05), // stands
                1 | 2 => {
                    // walks: the legs half a cycle apart
                    let cycle = phase + if sign > 0.0 { 0.0 } else { PI };
                    (
                        0.15 + 0.5 * cycle.sin(),
                        0.35 + 0.35 * (cycle + 0.9).cos(),
                        0.03,
                    )
                }
                3 => {
                    let down = 1.7 * depth; // crouches
                    (down, 1.15 * down, 0.25)
                }
                4 => (1.45, 1.5 - 0.4 * depth, 0.2), // sits
                _ => {
                    // stands wide, or in a lunge or a kick, each leg for itself
                    let flex = self.within(-0.4, 1.3);
                    (flex, self.within(0.0, 1.2), self.within(0.0, 0.45))
                }
            };
            let flex = flex + self.around(0.1);
            let bend = (bend + self.around(0.1)).max(0.0);
            let spread = sign * (spread + self.around(0.05));
            let twist = sign * self.around(0.2);
            let rotation = Quat::from_rotation_z(spread)
                * Quat::from_rotation_x(-flex)
                * Quat::from_rotation_y(twist);
            pose.set_rotation(hip, rotation);
            pose.set_axis_angle(knee, Vec3::new(bend, self.around(0.12), self.around(0.05)));
            let level = (flex - bend).clamp(-0.6, 0.6);
            pose.set_axis_angle(
                ankle,
                Vec3::new(level, self.around(0.25), self.around(0.12)),
            );
            let toes = if sign > 0.0 {
                Joint::LeftFoot
            } else {
                Joint::RightFoot
            };
            pose.set_axis_angle(toes, Vec3::X * (self.around(0.2) - 0.15 * level));
        }
    }

    fn torso(&mut self, pose: &mut MotionParams) {
        let wide = if self.rng.u8(0..4) == 0 { 2.2 } else { 1.0 };
        let bend = self.around(0.18 * wide) + 0.1 * wide * self.rng.f32();
        let turn = self.around(0.2 * wide);
        let lean = self.around(0.1 * wide);
        for (joint, share) in [
            (Joint::Spine1, 0.35),
            (Joint::Spine2, 0.35),
            (Joint::Spine3, 0.3),
        ] {
            let jitter = Vec3::new(self.around(0.04), self.around(0.04), self.around(0.03));
            pose.set_axis_angle(joint, Vec3::new(bend, turn, lean) * share * 1.6 + jitter);
        }
        let nod = self.around(0.2) - 0.3 * bend;
        let (look, tilt) = (self.around(0.35) - 0.3 * turn, self.around(0.12));
        for (joint, share) in [(Joint::Neck, 0.45), (Joint::Head, 0.55)] {
            let jitter = Vec3::new(self.around(0.06), self.around(0.06), self.around(0.04));
            pose.set_axis_angle(joint, Vec3::new(nod, look, tilt) * share + jitter);
        }
    }

    fn arm(&mut self, pose: &mut MotionParams, side: usize, action: u8) {
        let (sign, [collar, shoulder, elbow, wrist], _, _) = SIDES[side];
        // Where the upper arm points (out to its side, up, forward), the elbow's flexion and the upper arm's roll.
        let (towards, flex, roll) = match action {
            0 | 1 => (
                Vec3::new(0.22, -1.0, self.within(-0.15, 0.15)),
                self.within(0.05, 0.45),
                0.0,
            ), // hangs
            2 => (
                Vec3::new(0.2, -1.0, self.within(-0.7, 0.8)),
                self.within(0.1, 0.8),
                0.0,
            ), // swings
            3 => {
                let up = self.within(-0.6, 0.7);
                (
                    Vec3::new(self.within(-0.1, 0.9), up, 1.0),
                    self.within(0.0, 0.7),
                    0.0,
                ) // reaches
            }
            4 => (
                Vec3::new(self.within(0.1, 0.5), self.within(-0.9, 0.1), 0.8),
                self.within(0.3, 2.2),
                0.3,
            ), // punches, guards
            5 => (
                Vec3::new(self.within(0.1, 1.0), 1.0, self.within(-0.1, 0.5)),
                self.within(0.0, 1.6),
                0.0,
            ), // arms up
            6 => (Vec3::new(0.15, -1.0, 0.45), self.within(1.3, 1.9), -0.9), // crosses them
            7 => (Vec3::new(0.75, -1.0, -0.3), self.within(1.2, 1.8), -0.5), // hands on the hips
            8 => (
                Vec3::new(self.within(0.25, 0.6), -1.0, self.within(0.0, 0.5)),
                self.within(0.7, 2.0),
                self.within(-0.3, 0.6),
            ), // gestures
            _ => (
                Vec3::new(1.0, self.within(-0.9, 0.4), self.within(-0.4, 0.9)),
                self.within(0.0, 1.6),
                self.within(-0.6, 0.6),
            ), // anywhere
        };
        let towards = (towards
            + Vec3::new(self.around(0.12), self.around(0.12), self.around(0.12)))
        .normalize_or(Vec3::NEG_Y);
        let towards = Vec3::new(sign * towards.x, towards.y, towards.z);
        // The collar takes a quarter of what lifts the arm above the horizontal and draws it forward.
        let raise = 0.35 * (towards.y + 0.3).max(0.0) + self.around(0.06);
        let forward = 0.2 * towards.z.max(0.0) + self.around(0.05);
        pose.set_axis_angle(
            collar,
            Vec3::new(self.around(0.06), -sign * forward, sign * raise),
        );
        let swing = Quat::from_rotation_arc(Vec3::X * sign, towards);
        let roll = roll + self.around(0.3);
        let body_from_collar = pose.rotation(collar);
        pose.set_rotation(
            shoulder,
            body_from_collar.conjugate() * swing * Quat::from_rotation_x(-roll),
        );
        let pronation = self.around(0.55);
        pose.set_rotation(
            elbow,
            Quat::from_rotation_y(-sign * (flex + self.around(0.08)).max(0.0))
                * Quat::from_rotation_x(pronation),
        );
        let bend = Vec3::new(self.around(0.35), self.around(0.4), self.around(0.4));
        pose.set_axis_angle(wrist, bend);
    }

    fn hand(&mut self, pose: &mut MotionParams, side: usize) {
        let (sign, _, _, first) = SIDES[side];
        let fist = match self.rng.u8(0..4) {
            0 => self.within(0.9, 1.5),
            1 => 0.0,
            _ => self.within(0.1, 0.6),
        };
        for (at, joint) in Joint::ALL[first..first + FINGER_JOINTS].iter().enumerate() {
            let thumb = at >= 12;
            let curl = if thumb { 0.3 * fist } else { fist } + self.around(0.12);
            let spread = if at % 3 == 0 { self.around(0.1) } else { 0.0 };
            let turn = if thumb { -sign * curl } else { spread };
            let lift = if thumb {
                self.around(0.15)
            } else {
                -sign * curl
            };
            pose.set_axis_angle(*joint, Vec3::new(self.around(0.04), turn, lift));
        }
    }

    fn face(&mut self, pose: &mut MotionParams) {
        let mut jaw = self.within(0.0, 0.12);
        let mixed = if self.expressions.is_empty() {
            0
        } else {
            self.rng.usize(0..4)
        };
        for _ in 0..mixed {
            let which = self.rng.usize(0..self.expressions.len());
            let strength = self.within(0.2, 1.0);
            if let Some(preset) = self.expressions.values().nth(which) {
                for (value, coefficient) in
                    pose.expression_mut().iter_mut().zip(preset.coefficients)
                {
                    *value += strength * coefficient;
                }
                jaw += strength * preset.jaw;
            }
        }
        for slot in 0..self.components {
            let value = self.around(0.25);
            pose.expression_mut()[slot] += value;
        }
        pose.set_axis_angle(
            Joint::Jaw,
            Vec3::new(jaw.clamp(-0.05, 0.45), self.around(0.02), 0.0),
        );
        let gaze = Vec3::new(self.around(0.15), self.around(0.25), 0.0);
        pose.set_axis_angle(Joint::LeftEye, gaze);
        pose.set_axis_angle(Joint::RightEye, gaze);
    }

    /// Some poses on the way from the T-pose, and some at the limits of what joints can do: a network is well-behaved where it
    /// was trained, and dancers reach them.
    fn vary(&mut self, pose: &mut MotionParams) {
        match self.rng.u8(0..24) {
            0 | 1 => {
                let share = self.rng.f32();
                pose.values_mut().iter_mut().for_each(|v| *v *= share);
            }
            2..=4 => {
                for _ in 0..self.rng.u8(1..4) {
                    self.stretch(pose);
                }
            }
            _ => {}
        }
    }

    /// Takes one limb, the trunk or the head to anywhere in its range.
    fn stretch(&mut self, pose: &mut MotionParams) {
        let side = self.rng.usize(0..2);
        let (sign, [_, shoulder, elbow, wrist], [hip, knee, _], _) = SIDES[side];
        match self.rng.u8(0..5) {
            0 | 1 => {
                let (flex, spread) = (self.within(-0.9, 2.6), sign * self.within(-0.3, 1.3));
                let turn = Quat::from_rotation_y(self.around(0.4));
                let rotation = Quat::from_rotation_z(spread) * Quat::from_rotation_x(-flex) * turn;
                pose.set_rotation(hip, rotation);
                let bend = Vec3::X * self.within(0.0, 2.5);
                pose.set_axis_angle(knee, bend);
            }
            2 => {
                let whole = Vec3::new(
                    self.within(-0.5, 1.4),
                    self.within(-1.0, 1.0),
                    self.within(-0.7, 0.7),
                );
                for joint in [Joint::Spine1, Joint::Spine2, Joint::Spine3] {
                    let jitter = Vec3::new(self.around(0.08), self.around(0.08), self.around(0.06));
                    pose.set_axis_angle(joint, whole / 3.0 + jitter);
                }
            }
            3 => {
                let towards = Vec3::new(
                    self.within(-0.4, 1.0),
                    self.within(-1.0, 1.0),
                    self.within(-0.8, 1.0),
                );
                let towards = Vec3::new(sign * towards.x, towards.y, towards.z);
                let swing =
                    Quat::from_rotation_arc(Vec3::X * sign, towards.normalize_or(Vec3::X * sign));
                let roll = Quat::from_rotation_x(self.within(-1.3, 1.3));
                pose.set_rotation(shoulder, swing * roll);
                let bend = Quat::from_rotation_y(-sign * self.within(0.0, 2.5));
                let turn = Quat::from_rotation_x(self.within(-1.3, 1.3));
                pose.set_rotation(elbow, bend * turn);
                let hand = Vec3::new(self.around(0.5), self.around(0.35), self.around(0.6));
                pose.set_axis_angle(wrist, hand);
            }
            _ => {
                let whole = Vec3::new(
                    self.within(-1.0, 1.0),
                    self.within(-1.4, 1.4),
                    self.within(-0.7, 0.7),
                );
                let share = self.within(0.2, 0.8);
                pose.set_axis_angle(Joint::Neck, whole * share);
                pose.set_axis_angle(Joint::Head, whole * (1.0 - share));
            }
        }
    }
}
