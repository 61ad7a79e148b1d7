//! A headset's wearer: what their head and hands did is what the avatar does, by a forward kinematics of the tests' own.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "tests fail by panicking; poses are narrowed for OpenXR's f32"
)]

mod common;

use common::{M3, V3, add, angle, forward, frames, mul, mul_v, norm, recording, rodrigues};
use common::{scale, skeleton, sub, transpose};
use glam::{Affine3A, Mat3A, Vec3A};
use motion_fit::wearer::{HAND_JOINTS, Stance, WearerFit, WearerHand, WearerSample};
use spmm3::{Joint, MotionParams, Skeleton};

const HEAD: usize = 15;
const WRISTS: [usize; 2] = [20, 21];
/// A half turn about y.
const TURNED: M3 = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
/// Of an `OpenXR` joint whose hand is in T-pose, as the specification describes it: columns are x, y, z; fingers along -z, the back along y.
const HAND_AXES: [M3; 2] = [
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
];

fn affine(rotation: &M3, at: V3) -> Affine3A {
    let column = |c: usize| Vec3A::from_array([0, 1, 2].map(|r| rotation[r][c] as f32));
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: Vec3A::from_array(at.map(|v| v as f32)),
    }
}

fn rest(skeleton: &Skeleton, joint: usize) -> V3 {
    skeleton.rest_positions()[joint].to_array().map(f64::from)
}

fn eyes(skeleton: &Skeleton) -> V3 {
    let [left, right] = [Joint::LeftEye, Joint::RightEye].map(|j| rest(skeleton, j.index()));
    scale(add(left, right), 0.5)
}

/// A person who is truly in the headset: floor space is motion space turned by half.
struct Truth<'a> {
    skeleton: &'a Skeleton,
    /// The wearer's size over the avatar's.
    size: f64,
}

impl Truth<'_> {
    fn floor(&self, motion: V3) -> V3 {
        scale(mul_v(&TURNED, motion), self.size)
    }

    fn eyes(&self, motion: &MotionParams) -> V3 {
        let (rotations, positions) = forward(self.skeleton, motion);
        let from_head = sub(eyes(self.skeleton), rest(self.skeleton, HEAD));
        add(positions[HEAD], mul_v(&rotations[HEAD], from_head))
    }

    fn sample(&self, seconds: f64, motion: &MotionParams) -> WearerSample {
        let (rotations, _) = forward(self.skeleton, motion);
        let view = mul(&mul(&TURNED, &rotations[HEAD]), &TURNED);
        WearerSample {
            seconds,
            floor_from_view: Some(affine(&view, self.floor(self.eyes(motion)))),
            hands: [0, 1].map(|side| WearerHand {
                joints: Some(self.hand(side, motion)),
                floor_from_grip: None,
            }),
            origin: 0,
        }
    }

    /// The hand's joints: each finger bent as `motion` says.
    fn hand(&self, side: usize, motion: &MotionParams) -> [Option<Affine3A>; HAND_JOINTS] {
        let (rotations, positions) = forward(self.skeleton, motion);
        let wrist = WRISTS[side];
        let mut joints = [None; HAND_JOINTS];
        let mut set = |joint: usize, turn: &M3, at: V3| {
            let axes = mul(&mul(&TURNED, turn), &HAND_AXES[side]);
            joints[joint] = Some(affine(&axes, self.floor(at)));
        };
        set(1, &rotations[wrist], positions[wrist]);
        // Index, middle, little, ring, thumb, in SMPL-X's order; where each one's first joint is in OpenXR's.
        let first = 25 + 15 * side;
        for (finger, to) in [7, 12, 22, 17, 2].into_iter().enumerate() {
            let (mut turn, mut at, mut parent) = (rotations[wrist], positions[wrist], wrist);
            for bone in 0..3 {
                let joint = first + 3 * finger + bone;
                let along = sub(rest(self.skeleton, joint), rest(self.skeleton, parent));
                at = add(at, mul_v(&turn, along));
                let bend = motion.axis_angle(Joint::ALL[joint]).to_array();
                turn = mul(&turn, &rodrigues(bend.map(f64::from)));
                set(to + bone, &turn, at);
                if bone == 2 {
                    // The tip continues the last bone.
                    set(to + 3, &turn, add(at, mul_v(&turn, along)));
                }
                parent = joint;
            }
        }
        joints
    }
}

/// Distances of a fit from the truth, metres and radians.
#[derive(Default)]
struct Errors {
    head: Vec<f64>,
    head_turn: Vec<f64>,
    wrists: Vec<f64>,
    wrist_turns: Vec<f64>,
    elbows: Vec<f64>,
    hips: Vec<f64>,
    lowest: f64,
    /// Of standing balls of the feet, m/s.
    slides: Vec<f64>,
}

fn percentile(values: &[f64], share: f64) -> f64 {
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

/// Fits what `truth`'s wearer does in `motions`, `hz` a second.
fn follow(truth: &Truth<'_>, motions: &[MotionParams], hz: f64) -> Errors {
    let skeleton = truth.skeleton;
    let mut fit = WearerFit::new(skeleton, Stance::Standing);
    let mut errors = Errors::default();
    let mut before: Option<[V3; 4]> = None;
    for (number, motion) in motions.iter().enumerate() {
        let sample = truth.sample(number as f64 / hz, motion);
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

fn print(name: &str, errors: &Errors) {
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
        "  elbows {:.0?} mm, hips {:.0?} mm",
        mm(&errors.elbows),
        mm(&errors.hips)
    );
    println!(
        "  soles at lowest {:.1} mm, balls on the floor slide {:.0?} mm/s",
        errors.lowest * 1e3,
        mm(&errors.slides)
    );
}

fn check(errors: &Errors) {
    assert!(percentile(&errors.head, 1.0) < 0.01, "the head");
    assert!(percentile(&errors.head_turn, 1.0) < 0.05, "the look");
    assert!(percentile(&errors.wrists, 0.95) < 0.03, "the wrists");
    assert!(percentile(&errors.elbows, 0.5) < 0.12, "the elbows");
    assert!(errors.lowest > -0.03, "the floor");
    assert!(percentile(&errors.slides, 0.5) < 0.05, "sliding feet");
}

#[test]
fn a_real_walk_and_real_punches_are_the_avatars_by_head_and_hands_alone() {
    let skeleton = skeleton();
    for name in ["mocap/cmu_02_01_walk.bvh", "mocap/cmu_02_05_punch.bvh"] {
        let Some(clip) = recording(name) else {
            return;
        };
        for size in [1.0, 1.08] {
            let truth = Truth {
                skeleton: &skeleton,
                size,
            };
            let errors = follow(&truth, &frames(&clip, 72.0), 72.0);
            print(&format!("{name}, wearer of {size}"), &errors);
            check(&errors);
        }
    }
}
