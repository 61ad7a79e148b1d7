//! Captures of real people on our skeleton: limbs point where the source's point, joints land where they must.

use crate::{
    man,
    reference::{Bvh, degrees_between, lowest_sole, person},
};
use glam::{DMat3, DVec3};
use spmm3::{Joint, LoadOptions, MotionClip, MotionParams};
use synthetic_person::real_files::real_file;

/// Retargeting is exact for limbs; what is left is single precision.
const LIMB_DEGREES: f64 = 0.2;
/// Hips to neck, beyond what already differs at rest because rigs put these joints at other places of the body.
const SPINE_DEGREES: f64 = 1.0;
/// A hand or foot at the end of a chain of our bones along the source's directions, metres.
const JOINT_METRES: f64 = 2e-3;

/// A rig's names for the ends of each limb, hip to ankle and shoulder to wrist, left then right, and of the neck.
struct Rig {
    legs: [[&'static str; 3]; 2],
    arms: [[&'static str; 3]; 2],
    neck: &'static str,
    /// The file's axes, as columns, in ours.
    our_from_file: DMat3,
    positions_add: bool,
}

fn cmu() -> Rig {
    Rig {
        legs: [
            ["LeftUpLeg", "LeftLeg", "LeftFoot"],
            ["RightUpLeg", "RightLeg", "RightFoot"],
        ],
        arms: [
            ["LeftArm", "LeftForeArm", "LeftFingerBase"],
            ["RightArm", "RightForeArm", "RightFingerBase"],
        ],
        neck: "Neck",
        our_from_file: DMat3::IDENTITY,
        positions_add: false,
    }
}

/// z up, facing -y.
const Y_UP_FROM_Z_UP: DMat3 = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);

fn old_makehuman() -> Rig {
    Rig {
        legs: [
            ["UpLeg_L", "LoLeg_L", "Foot_L"],
            ["UpLeg_R", "LoLeg_R", "Foot_R"],
        ],
        arms: [
            ["UpArm_L", "LoArm_L", "Hand_L"],
            ["UpArm_R", "LoArm_R", "Hand_R"],
        ],
        neck: "Neck",
        our_from_file: Y_UP_FROM_Z_UP,
        positions_add: true,
    }
}

fn new_makehuman() -> Rig {
    Rig {
        legs: [
            ["upperleg01.L", "lowerleg01.L", "foot.L"],
            ["upperleg01.R", "lowerleg01.R", "foot.R"],
        ],
        arms: [
            ["upperarm01.L", "lowerarm01.L", "wrist.L"],
            ["upperarm01.R", "lowerarm01.R", "wrist.R"],
        ],
        neck: "neck01",
        our_from_file: Y_UP_FROM_Z_UP,
        positions_add: true,
    }
}

const LEGS: [[Joint; 3]; 2] = [
    [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle],
    [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle],
];
const ARMS: [[Joint; 3]; 2] = [
    [Joint::LeftShoulder, Joint::LeftElbow, Joint::LeftWrist],
    [Joint::RightShoulder, Joint::RightElbow, Joint::RightWrist],
];

fn load(name: &str) -> Option<(Bvh, MotionClip)> {
    let path = real_file(name)?;
    let text = std::fs::read_to_string(&path).expect("a readable file");
    let clip = MotionClip::load(&path, &man(), &LoadOptions::default())
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let source = Bvh::read(&text);
    assert_eq!(
        clip.frames.len(),
        source.frames.len(),
        "{name}: every frame is kept"
    );
    Some((source, clip))
}

/// Limb directions, joint positions, bends of knees and elbows, and the torso's direction over a whole file.
fn limbs_follow(name: &str, rig: &Rig) {
    let Some((source, clip)) = load(name) else {
        return;
    };
    let skeleton = man();
    let torso_at_rest = {
        let theirs = source.rest();
        let at = |name: &str| rig.our_from_file * theirs[name].0;
        let ours = person(&skeleton, &MotionParams::default());
        let our = |joint: Joint| ours[joint.index()].0;
        degrees_between(
            at(rig.neck) - (at(rig.legs[0][0]) + at(rig.legs[1][0])) * 0.5,
            our(Joint::Neck) - (our(Joint::LeftHip) + our(Joint::RightHip)) * 0.5,
        )
    };
    let mut worst = [0.0f64; 3];
    let step = (source.frames.len() / 60).max(1);
    for frame in (0..source.frames.len()).step_by(step) {
        let theirs = source.pose(frame, rig.positions_add);
        let at = |name: &str| rig.our_from_file * theirs[name].0;
        let ours = person(&skeleton, &clip.frames[frame]);
        let our = |joint: Joint| ours[joint.index()].0;
        let limbs = LEGS.iter().zip(&rig.legs).chain(ARMS.iter().zip(&rig.arms));
        for ([a, b, c], [a_name, b_name, c_name]) in limbs {
            let upper = (at(b_name) - at(a_name)).normalize();
            let lower = (at(c_name) - at(b_name)).normalize();
            let our_upper = our(*b) - our(*a);
            let our_lower = our(*c) - our(*b);
            worst[0] = worst[0]
                .max(degrees_between(upper, our_upper))
                .max(degrees_between(lower, our_lower));
            let end = our(*a) + upper * our_upper.length() + lower * our_lower.length();
            worst[1] = worst[1].max(end.distance(our(*c)));
            let bend = degrees_between(upper, lower);
            let our_bend = degrees_between(our_upper, our_lower);
            assert!(
                (bend - our_bend).abs() < 2.0 * LIMB_DEGREES,
                "{name} frame {frame}: {} bends by {our_bend:.1} degrees, the source by {bend:.1}",
                b.name()
            );
        }
        let hips = (at(rig.legs[0][0]) + at(rig.legs[1][0])) * 0.5;
        let our_hips = (our(Joint::LeftHip) + our(Joint::RightHip)) * 0.5;
        worst[2] = worst[2].max(degrees_between(
            at(rig.neck) - hips,
            our(Joint::Neck) - our_hips,
        ));
    }
    println!(
        "{name}: limbs within {:.4} degrees, ends within {:.2} mm, torso within {:.2} degrees (at rest {torso_at_rest:.2})",
        worst[0],
        worst[1] * 1e3,
        worst[2]
    );
    assert!(
        worst[0] < LIMB_DEGREES,
        "{name}: a limb is {:.3} degrees off",
        worst[0]
    );
    assert!(
        worst[1] < JOINT_METRES,
        "{name}: a joint is {:.4} m off",
        worst[1]
    );
    assert!(
        torso_at_rest < 8.0,
        "{name}: the torsos differ by {torso_at_rest:.2} degrees at rest"
    );
    assert!(
        worst[2] < torso_at_rest + SPINE_DEGREES,
        "{name}: the torso is {:.2} degrees off",
        worst[2]
    );
}

/// Twist about the bone and bend of a hinge, degrees: the joint's rotation about `along` and about `hinge`.
fn twist_and_bend(motion: &MotionParams, joint: Joint, along: DVec3, hinge: DVec3) -> (f64, f64) {
    let turn = motion.rotation(joint).as_dquat();
    let about = |axis: DVec3| {
        let angle = 2.0 * turn.xyz().dot(axis).atan2(turn.w);
        (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
    };
    (about(along).to_degrees(), about(hinge).to_degrees())
}

/// Knees bend backwards only, elbows forwards only, and no joint twists about its bone.
fn no_joint_is_twisted(name: &str) {
    let Some((_, clip)) = load(name) else {
        return;
    };
    let mut range = [[0.0f64; 2]; 4];
    for motion in &clip.frames {
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let hinges = [
                (LEGS[side][1], DVec3::NEG_Y, DVec3::X),
                (ARMS[side][1], DVec3::X * sign, DVec3::NEG_Y * sign),
            ];
            for (kind, (joint, along, hinge)) in hinges.into_iter().enumerate() {
                let (twist, bend) = twist_and_bend(motion, joint, along, hinge);
                let [twists, bends] = [2 * kind, 2 * kind + 1];
                range[twists][1] = range[twists][1].max(twist.abs());
                range[bends][0] = range[bends][0].min(bend);
                range[bends][1] = range[bends][1].max(bend);
            }
        }
    }
    let [knee_twist, knee, elbow_twist, elbow] = range;
    println!(
        "{name}: knees twist {:.0}, bend {:.0}..{:.0}; elbows twist {:.0}, bend {:.0}..{:.0} degrees",
        knee_twist[1], knee[0], knee[1], elbow_twist[1], elbow[0], elbow[1]
    );
    assert!(
        knee_twist[1] < 10.0,
        "{name}: a shank turns {:.0} degrees about itself",
        knee_twist[1]
    );
    assert!(
        elbow_twist[1] < 40.0,
        "{name}: a forearm turns {:.0} degrees about itself",
        elbow_twist[1]
    );
    assert!(
        knee[0] > -5.0,
        "{name}: a knee bends {:.0} degrees the wrong way",
        knee[0]
    );
    assert!(
        elbow[0] > -5.0,
        "{name}: an elbow bends {:.0} degrees the wrong way",
        elbow[0]
    );
}

#[test]
fn a_captured_walk_keeps_its_limbs() {
    limbs_follow("mocap/cmu_02_01_walk.bvh", &cmu());
    no_joint_is_twisted("mocap/cmu_02_01_walk.bvh");
}

#[test]
fn captured_punches_keep_their_limbs() {
    limbs_follow("mocap/cmu_02_05_punch.bvh", &cmu());
    no_joint_is_twisted("mocap/cmu_02_05_punch.bvh");
}

#[test]
fn makehuman_poses_keep_their_limbs() {
    limbs_follow("human/walk1.bvh", &old_makehuman());
    no_joint_is_twisted("human/walk1.bvh");
    limbs_follow("human/dance1.bvh", &old_makehuman());
    limbs_follow("human/tpose.bvh", &new_makehuman());
    limbs_follow("human/face-poseunits.bvh", &new_makehuman());
}

#[test]
fn a_captured_walk_goes_forward_on_alternating_feet() {
    let Some((source, clip)) = load("mocap/cmu_02_01_walk.bvh") else {
        return;
    };
    let skeleton = man();
    let first = clip.frames[0].root_translation;
    let rest = skeleton.rest_positions()[Joint::Pelvis.index()];
    assert!(
        (first.x + rest.x).hypot(first.z + rest.z) < 1e-4,
        "the clip begins over the origin"
    );
    let mut ahead = Vec::new();
    let mut low = Vec::new();
    let mut previous = f64::NEG_INFINITY;
    let leg = |names: &[&str; 3]| {
        let rest = source.pose(0, false);
        (rest[names[1]].0 - rest[names[0]].0).length()
            + (rest[names[2]].0 - rest[names[1]].0).length()
    };
    let our_leg = |joints: &[Joint; 3]| {
        f64::from(
            skeleton.rest_offset(joints[1]).length() + skeleton.rest_offset(joints[2]).length(),
        )
    };
    let rig = cmu();
    let scale = (our_leg(&LEGS[0]) + our_leg(&LEGS[1])) / (leg(&rig.legs[0]) + leg(&rig.legs[1]));
    let middle = |frame: usize| {
        let pose = source.pose(frame, false);
        (pose["LeftUpLeg"].0 + pose["RightUpLeg"].0) * 0.5 * scale
    };
    let hips = |frame: usize| {
        let world = person(&skeleton, &clip.frames[frame]);
        (world[Joint::LeftHip.index()].0 + world[Joint::RightHip.index()].0) * 0.5
    };
    for (frame, motion) in clip.frames.iter().enumerate() {
        let world = person(&skeleton, motion);
        let pelvis = world[Joint::Pelvis.index()].0.z;
        assert!(
            pelvis > previous - 2e-3,
            "frame {frame}: the walker steps back"
        );
        previous = pelvis;
        ahead.push(world[Joint::LeftAnkle.index()].0.z > world[Joint::RightAnkle.index()].0.z);
        low.push(lowest_sole(&skeleton, motion));
        let away = hips(frame) - hips(0) - (middle(frame) - middle(0));
        assert!(
            away.x.hypot(away.z) < 2e-3 && away.y.abs() < 0.06,
            "frame {frame}: the hips are {away} m from the scaled source's (the floor may drift by centimetres)"
        );
    }
    assert!(previous > 2.5, "the walker covers {previous:.2} m");
    let changes = ahead.windows(2).filter(|w| w[0] != w[1]).count();
    assert!(
        (4..=8).contains(&changes),
        "the feet pass each other {changes} times"
    );
    soles_near_the_floor("walk", &low);
}

/// Nine frames in ten within 2.5 cm of the floor, none deeper than 3 cm below it.
fn soles_near_the_floor(name: &str, low: &[f64]) {
    let near = low.iter().filter(|y| y.abs() < 0.025).count();
    let deepest = low.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = low.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    println!(
        "{name}: lowest sole {:.1}..{:.1} mm, {near} of {} frames within 25 mm",
        deepest * 1e3,
        highest * 1e3,
        low.len()
    );
    assert!(
        near * 10 >= low.len() * 9,
        "{name}: {near} of {} frames stand",
        low.len()
    );
    assert!(
        deepest > -0.03,
        "{name}: a sole is {deepest:.3} m under the floor"
    );
}

#[test]
fn a_puncher_stands_on_the_floor_and_reaches_out() {
    let Some((_, clip)) = load("mocap/cmu_02_05_punch.bvh") else {
        return;
    };
    let skeleton = man();
    let low: Vec<f64> = clip
        .frames
        .iter()
        .map(|m| lowest_sole(&skeleton, m))
        .collect();
    soles_near_the_floor("punch", &low);
    let reach: Vec<f64> = clip
        .frames
        .iter()
        .map(|motion| {
            let world = person(&skeleton, motion);
            let [shoulder, _, wrist] = ARMS[1].map(|joint| world[joint.index()].0);
            shoulder.distance(wrist)
        })
        .collect();
    let arm: f64 = ARMS[1][1..]
        .iter()
        .map(|joint| f64::from(skeleton.rest_offset(*joint).length()))
        .sum();
    let bent = reach.iter().copied().fold(f64::INFINITY, f64::min) / arm;
    let straight = reach.iter().copied().fold(0.0, f64::max) / arm;
    assert!(
        bent < 0.75 && straight > 0.95,
        "a punch goes from {bent:.2} to {straight:.2} of the arm"
    );
}

#[test]
fn makehumans_t_pose_is_ours() {
    let Some((_, clip)) = load("human/tpose.bvh") else {
        return;
    };
    // The skeleton of these tests was measured on a body in this very pose. MakeHuman lifts the shoulders for it from
    // its own rest pose, and collars keep such a lift: no rig defines its collars' rest.
    for joint in Joint::ALL {
        let angle = clip.frames[0].axis_angle(joint).length().to_degrees();
        let limit = match joint {
            Joint::LeftCollar | Joint::RightCollar | Joint::LeftShoulder | Joint::RightShoulder => {
                20.0
            }
            joint if joint >= Joint::LeftIndex1 => 35.0,
            _ => 12.0,
        };
        assert!(
            angle < limit,
            "{} is turned by {angle:.1} degrees in a T-pose",
            joint.name()
        );
    }
}

#[test]
fn makehumans_face_units_move_jaw_and_eyes_and_nothing_below_the_neck() {
    let Some((_, clip)) = load("human/face-poseunits.bvh") else {
        return;
    };
    let most = |joint: Joint| {
        let reference = clip.frames[0].rotation(joint);
        clip.frames
            .iter()
            .map(|m| m.rotation(joint).angle_between(reference).to_degrees())
            .fold(0.0, f32::max)
    };
    let jaw = clip
        .frames
        .iter()
        .map(|m| m.axis_angle(Joint::Jaw).x.to_degrees())
        .fold(0.0, f32::max);
    assert!(
        (5.0..45.0).contains(&jaw),
        "the jaw opens by {jaw:.1} degrees"
    );
    for eye in [Joint::LeftEye, Joint::RightEye] {
        assert!(
            most(eye) > 8.0,
            "{} turns by {:.1} degrees only",
            eye.name(),
            most(eye)
        );
    }
    for joint in Joint::ALL {
        if !matches!(joint, Joint::Jaw | Joint::LeftEye | Joint::RightEye) {
            assert!(
                most(joint) < 1.0,
                "{} turns by {:.2} degrees",
                joint.name(),
                most(joint)
            );
        }
    }
    let notes = clip.notes.join("; ");
    assert!(
        notes.contains("decimetres") && !notes.contains("levator"),
        "the notes name the unit, and joints stand by themselves: {notes}"
    );
    let levators = |clip: &MotionClip| {
        let names = clip.unmapped.iter();
        names.filter(|name| name.starts_with("levator")).count()
    };
    let summary = clip.unmapped_summary().expect("unmapped joints");
    assert!(
        levators(&clip) > 2 && summary.matches("levator").count() == 1,
        "each joint in the list, alike ones once in the summary: {summary}"
    );
}
