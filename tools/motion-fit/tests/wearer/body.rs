//! The tracked body: joints of a recorded motion as a runtime gives them, each with axes of its own.

use crate::common::{
    M3, Random, V3, add, forward, frames, mul, norm, recording, rodrigues, scale, skeleton, sub,
};
use crate::errors::{Errors, check, check_slides, follow, percentile, print};
use crate::truth::{TURNED, Truth, affine, rest};
use glam::Vec3;
use motion_fit::wearer::{Stance, WEARER_JOINTS, WearerBody, WearerFit, WearerHand};
use motion_fit::wearer::{WearerJoint, WearerSample};
use spmm3::{Joint, MotionParams, Skeleton};

/// Joints of `XrFullBodyJointMETA`, and SMPL-X's that are there: of both sides, by the names in the specification.
const PAIRS: [(usize, usize); 20] = [
    (1, 0),   // HIPS: pelvis
    (2, 3),   // SPINE_LOWER: spine1
    (3, 6),   // SPINE_MIDDLE: spine2
    (5, 9),   // CHEST: spine3
    (6, 12),  // NECK
    (7, 15),  // HEAD
    (10, 16), // LEFT_ARM_UPPER: left_shoulder
    (11, 18), // LEFT_ARM_LOWER: left_elbow
    (19, 20), // LEFT_HAND_WRIST
    (15, 17),
    (16, 19),
    (45, 21),
    (70, 1),  // LEFT_UPPER_LEG: left_hip
    (71, 4),  // LEFT_LOWER_LEG: left_knee
    (73, 7),  // LEFT_FOOT_ANKLE
    (76, 10), // LEFT_FOOT_BALL
    (77, 2),
    (78, 5),
    (80, 8),
    (83, 11),
];
/// The first joint of each hand.
const HANDS: [usize; 2] = [18, 44];
const UPPER: usize = 70;

/// A runtime: the axes that it gives to joints, and how it is turned when it thinks of a T-pose.
struct Runtime {
    axes: Vec<M3>,
    t_space: M3,
}

impl Runtime {
    fn new() -> Self {
        let mut random = Random(7);
        let axes = (0..WEARER_JOINTS).map(|_| rodrigues(random.normals()));
        Self {
            axes: axes.collect(),
            t_space: rodrigues([0.0, 2.1, 0.0]),
        }
    }

    /// The body of `truth` in `motion`, off by about `noise` metres.
    fn body(&self, truth: &Truth<'_>, motion: &MotionParams, noise: f64) -> WearerBody {
        let (turns, places) = forward(truth.skeleton, motion);
        let mut body = WearerBody {
            confidence: 0.9,
            joints: [None; WEARER_JOINTS],
            t_pose: [None; WEARER_JOINTS],
        };
        let mut random = Random(places[0].map(f64::to_bits).iter().fold(1, |a, b| a ^ b));
        for (to, from) in PAIRS {
            let axes = &self.axes[to];
            let turn = mul(&mul(&TURNED, &turns[from]), axes);
            let place = add(truth.floor(places[from]), scale(random.normals(), noise));
            body.joints[to] = Some(WearerJoint {
                floor_from_joint: affine(&turn, place),
                tracked: true,
            });
            let at = crate::common::mul_v(&self.t_space, rest(truth.skeleton, from));
            body.t_pose[to] = Some(affine(&mul(&self.t_space, axes), scale(at, truth.size)));
        }
        for (side, first) in HANDS.into_iter().enumerate() {
            for (joint, pose) in truth.hand(side, motion).into_iter().enumerate() {
                if let Some(pose) = pose.filter(|_| joint != 1) {
                    body.joints[first + joint] = Some(WearerJoint {
                        floor_from_joint: pose,
                        tracked: true,
                    });
                }
            }
        }
        body
    }
}

/// Fits every frame with what `sees` makes of the whole body.
fn followed(
    name: &str,
    size: f64,
    sees: impl Fn(&mut WearerSample, &mut WearerBody),
) -> Option<Errors> {
    let skeleton = skeleton();
    let clip = recording(name)?;
    let (truth, runtime) = (
        Truth {
            skeleton: &skeleton,
            size,
        },
        Runtime::new(),
    );
    let motions = frames(&clip, 72.0);
    Some(follow(&truth, &motions, 72.0, |sample| {
        let motion = &motions[(sample.seconds * 72.0).round() as usize];
        let mut body = runtime.body(&truth, motion, 0.003);
        sees(sample, &mut body);
        sample.body = Some(body);
    }))
}

const RECORDINGS: [&str; 2] = ["mocap/cmu_02_01_walk.bvh", "mocap/cmu_02_05_punch.bvh"];

#[test]
fn a_tracked_body_is_the_avatars_from_head_to_foot() {
    for name in RECORDINGS {
        for size in [1.0, 1.08] {
            let Some(errors) = followed(name, size, |_, _| {}) else {
                return;
            };
            print(&format!("{name}, wearer of {size}, whole body"), &errors);
            check(&errors);
            assert!(percentile(&errors.elbows, 0.95) < 0.03, "the elbows");
            assert!(percentile(&errors.knees, 0.95) < 0.03, "the knees");
            assert!(percentile(&errors.ankles, 0.95) < 0.03, "the ankles");
            assert!(percentile(&errors.hips, 0.95) < 0.03, "the hips");
        }
    }
}

#[test]
fn a_body_without_legs_has_its_arms_and_hips_where_they_are() {
    for name in RECORDINGS {
        let Some(errors) = followed(name, 1.0, |_, body| {
            body.joints[UPPER..].fill(None);
            body.t_pose[UPPER..].fill(None);
        }) else {
            return;
        };
        print(&format!("{name}, no legs"), &errors);
        check(&errors);
        check_slides(&errors);
        assert!(percentile(&errors.elbows, 0.95) < 0.03, "the elbows");
        assert!(percentile(&errors.hips, 0.95) < 0.05, "the hips");
    }
}

#[test]
fn hands_that_only_the_body_knows_are_where_it_says() {
    for name in RECORDINGS {
        let Some(errors) = followed(name, 1.0, |sample, _| {
            sample.hands = [WearerHand::default(); 2];
        }) else {
            return;
        };
        print(&format!("{name}, no other hands"), &errors);
        check(&errors);
        assert!(percentile(&errors.wrists, 0.95) < 0.03, "the wrists");
        assert!(percentile(&errors.wrist_turns, 0.95) < 0.3, "turned");
    }
}

#[test]
fn a_body_that_is_not_sure_of_itself_changes_nothing() {
    let name = RECORDINGS[1];
    let Some(unsure) = followed(name, 1.0, |_, body| body.confidence = 0.1) else {
        return;
    };
    let Some(none) = followed(name, 1.0, |_, body| {
        body.joints.fill(None);
        body.t_pose.fill(None);
    }) else {
        return;
    };
    let nan = followed(name, 1.0, |_, body| body.confidence = f32::NAN);
    assert_eq!(unsure.elbows, none.elbows, "as if there were none");
    assert_eq!(unsure.elbows, nan.expect("as above").elbows, "no number");
}

#[test]
fn a_body_that_comes_and_goes_does_not_make_the_avatar_jump() {
    let skeleton = skeleton();
    let Some(clip) = recording(RECORDINGS[1]) else {
        return;
    };
    let (truth, runtime) = (
        Truth {
            skeleton: &skeleton,
            size: 1.0,
        },
        Runtime::new(),
    );
    let mut fit = WearerFit::new(&skeleton, Stance::Standing);
    let motions = frames(&clip, 72.0);
    let mut before: Option<[[f64; 3]; 22]> = None;
    let mut worst = 0.0f64;
    for (number, motion) in motions.iter().enumerate() {
        let mut sample = truth.sample(number as f64 / 72.0, motion);
        let tracked = (number / 72) % 2 == 1;
        sample.body = tracked.then(|| runtime.body(&truth, motion, 0.0));
        let fitted = fit.step(&sample).expect("a head");
        let (_, joints) = forward(&skeleton, &fitted.motion);
        let (_, truly) = forward(&skeleton, motion);
        if let Some(before) = before {
            // More than the person themselves moves, at this rate.
            let (_, then) = forward(&skeleton, &motions[number - 1]);
            for joint in [0, 4, 5, 7, 8, 18, 19] {
                let step = norm(sub(joints[joint], before[joint]));
                let real = norm(sub(truly[joint], then[joint]));
                worst = worst.max(step - real);
            }
        }
        before = Some(joints);
    }
    println!(
        "the greatest step beyond the person's own: {:.1} mm",
        worst * 1e3
    );
    // Feet that step make 62 mm of their own; a body that counted at once would make 560.
    assert!(worst < 0.15, "a jump of {worst} m");
}

#[test]
fn joints_that_are_no_numbers_are_left_out() {
    let skeleton = skeleton();
    let (truth, runtime) = (
        Truth {
            skeleton: &skeleton,
            size: 1.0,
        },
        Runtime::new(),
    );
    let mut fit = WearerFit::new(&skeleton, Stance::Standing);
    let motion = MotionParams::default();
    for number in 0..40usize {
        let mut sample = truth.sample(number as f64 / 72.0, &motion);
        let mut body = runtime.body(&truth, &motion, 0.0);
        for (to, _) in PAIRS.iter().skip(number % PAIRS.len()) {
            if let Some(joint) = &mut body.joints[*to] {
                joint.floor_from_joint.translation.x = f32::NAN;
            }
            if let Some(pose) = &mut body.t_pose[*to] {
                pose.matrix3.x_axis.y = f32::INFINITY;
            }
        }
        sample.body = Some(body);
        let fitted = fit.step(&sample).expect("a head");
        let all = fitted.motion.values().iter().all(|value| value.is_finite());
        assert!(all, "frame {number}");
    }
}

/// The tests' skeleton with arms that are 6 % longer and legs that are 4 % shorter, standing on the same floor.
fn differently_built() -> Skeleton {
    let usual = skeleton();
    let old = usual.rest_positions();
    let mut rest = *old;
    for joint in Joint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let longer = match joint {
            Joint::LeftElbow | Joint::RightElbow | Joint::LeftWrist | Joint::RightWrist => 1.06,
            Joint::LeftKnee | Joint::RightKnee | Joint::LeftAnkle | Joint::RightAnkle => 0.96,
            _ => 1.0,
        };
        let along = old[joint.index()] - old[parent.index()];
        rest[joint.index()] = rest[parent.index()] + longer * along;
    }
    let ankle = Joint::LeftAnkle.index();
    let lower = old[ankle].y - rest[ankle].y;
    Skeleton::new(rest.map(|place| place + Vec3::Y * lower)).expect("finite")
}

#[test]
fn limbs_of_another_length_point_where_the_wearers_do() {
    let (avatar, built) = (skeleton(), differently_built());
    for name in RECORDINGS {
        let Some(clip) = recording(name) else {
            return;
        };
        let truth = Truth {
            skeleton: &built,
            size: 1.0,
        };
        let runtime = Runtime::new();
        let mut fit = WearerFit::new(&avatar, Stance::Standing);
        let mut origin = None;
        let (mut arms, mut legs, mut wrists) = (Vec::new(), Vec::new(), Vec::new());
        for (number, motion) in frames(&clip, 72.0).iter().enumerate() {
            let mut sample = truth.sample(number as f64 / 72.0, motion);
            sample.body = Some(runtime.body(&truth, motion, 0.003));
            let fitted = fit.step(&sample).expect("a head");
            let (_, truly) = forward(&built, motion);
            let (_, joints) = forward(&avatar, &fitted.motion);
            let floor = |at: V3| {
                let at = fit.floor_from_motion(glam::DVec3::from_array(at));
                at.expect("begun").to_array()
            };
            let start = *origin.get_or_insert(floor([0.0; 3]));
            assert_eq!(start, floor([0.0; 3]), "floor space stays");
            let direction = |from: V3, to: V3| {
                let along = sub(to, from);
                scale(along, 1.0 / norm(along))
            };
            let apart = |from: usize, to: usize| {
                let is = direction(floor(joints[from]), floor(joints[to]));
                let was = direction(truth.floor(truly[from]), truth.floor(truly[to]));
                2.0 * (norm(sub(is, was)) / 2.0).asin()
            };
            arms.extend([(16, 18), (18, 20), (17, 19), (19, 21)].map(|(a, b)| apart(a, b)));
            legs.extend([(1, 4), (4, 7), (2, 5), (5, 8)].map(|(a, b)| apart(a, b)));
            for wrist in [20, 21] {
                wrists.push(norm(sub(floor(joints[wrist]), truth.floor(truly[wrist]))));
            }
        }
        let [arms, legs] = [arms, legs].map(|all| [0.5, 0.95].map(|p| percentile(&all, p)));
        let wrists = percentile(&wrists, 0.95);
        println!(
            "{name}, other limbs: arms {:.1?} degrees, legs {:.1?} degrees (median, 95th percentile), wrists {:.1} mm",
            arms.map(f64::to_degrees),
            legs.map(f64::to_degrees),
            wrists * 1e3
        );
        assert!(
            arms[1] < 0.12 && legs[1] < 0.08,
            "{arms:?}, {legs:?} radians"
        );
        assert!(wrists < 0.03, "the wrists by {wrists} m");
    }
}
