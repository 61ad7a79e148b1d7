//! The built-in performance: it loops, stands, gestures, and moves the face it is given.

use crate::{
    man,
    reference::{lowest_sole, person},
};
use spmm3::{
    EXPRESSION, ExpressionPreset, Expressions, Joint, LOOP_SECONDS, MotionClip, MotionError,
    at_ease,
};

const NAMES: [&str; 11] = [
    "blink",
    "smile",
    "brows_up",
    "brows_down",
    "a",
    "e",
    "i",
    "o",
    "u",
    "mbp",
    "fv",
];

/// One coefficient per preset, and a jaw for the vowels.
fn face() -> Expressions {
    NAMES
        .into_iter()
        .enumerate()
        .map(|(k, name)| {
            let mut coefficients = [0.0; EXPRESSION];
            coefficients[k] = 1.0;
            let jaw = if name == "a" { 0.2 } else { 0.0 };
            (name.to_owned(), ExpressionPreset { coefficients, jaw })
        })
        .collect()
}

fn perform() -> MotionClip {
    MotionClip::built_in(&man(), &face(), LOOP_SECONDS, 60.0).expect("a performance")
}

#[test]
fn a_person_standing_still_stands_on_flat_soles_with_hanging_arms_and_a_neutral_face() {
    let (skeleton, motion) = (man(), at_ease(&man()));
    let world = person(&skeleton, &motion);
    let at = |joint: Joint| world[joint.index()].0;
    for (joint, rest) in Joint::ALL.into_iter().zip(skeleton.rest_positions()) {
        if matches!(
            joint,
            Joint::LeftAnkle | Joint::RightAnkle | Joint::LeftFoot | Joint::RightFoot
        ) {
            let off = at(joint).distance(rest.as_dvec3());
            assert!(off < 1e-3, "{} is {off} m off the stance", joint.name());
        }
    }
    for (wrist, shoulder, hip, side) in [
        (Joint::LeftWrist, Joint::LeftShoulder, Joint::LeftHip, 1.0),
        (
            Joint::RightWrist,
            Joint::RightShoulder,
            Joint::RightHip,
            -1.0,
        ),
    ] {
        let arm = at(wrist) - at(shoulder);
        assert!(-arm.y > 0.9 * arm.length(), "the arm does not hang: {arm}");
        let beside = side * (at(wrist).x - at(hip).x);
        assert!(
            (0.05..0.3).contains(&beside),
            "the hand is {beside} m beside the hip"
        );
    }
    assert!(
        motion.expression().iter().all(|e| *e == 0.0),
        "the face is not neutral"
    );
    assert_eq!(motion.axis_angle(Joint::Jaw), glam::Vec3::ZERO, "jaw");
}

#[test]
fn it_moves_without_a_jump_and_its_end_meets_its_beginning() {
    let clip = perform();
    let skeleton = man();
    assert_eq!(clip.frames.len(), 540, "nine seconds at 60 frames");
    let world: Vec<_> = clip.frames.iter().map(|m| person(&skeleton, m)).collect();
    let mut fastest = 0.0f64;
    for (k, now) in world.iter().enumerate() {
        let next = &world[(k + 1) % world.len()];
        for joint in Joint::ALL {
            let step = now[joint.index()].0.distance(next[joint.index()].0);
            fastest = fastest.max(step * 60.0);
            let turn = clip.frames[k]
                .rotation(joint)
                .angle_between(clip.frames[(k + 1) % world.len()].rotation(joint));
            assert!(
                turn < 0.2,
                "frame {k}: {} jumps by {turn} rad",
                joint.name()
            );
        }
    }
    assert!(
        (0.8..4.0).contains(&fastest),
        "the fastest joint moves at {fastest:.2} m/s"
    );
}

#[test]
fn both_soles_stay_planted() {
    let skeleton = man();
    let rest = person(&skeleton, &spmm3::MotionParams::default());
    for (k, motion) in perform().frames.iter().enumerate() {
        let world = person(&skeleton, motion);
        for joint in [
            Joint::LeftAnkle,
            Joint::RightAnkle,
            Joint::LeftFoot,
            Joint::RightFoot,
        ] {
            let away = world[joint.index()].0.distance(rest[joint.index()].0);
            assert!(
                away < 2e-3,
                "frame {k}: {} is {away} m from where it stands",
                joint.name()
            );
        }
        assert!(
            lowest_sole(&skeleton, motion).abs() < 2e-3,
            "frame {k}: a sole leaves the floor"
        );
    }
}

#[test]
fn knees_and_elbows_bend_as_a_persons_do() {
    for (k, motion) in perform().frames.iter().enumerate() {
        for knee in [Joint::LeftKnee, Joint::RightKnee] {
            let bend = motion.axis_angle(knee).x.to_degrees();
            assert!(
                (-1.0..45.0).contains(&bend),
                "frame {k}: a knee at {bend} degrees"
            );
        }
        for (elbow, sign) in [(Joint::LeftElbow, -1.0), (Joint::RightElbow, 1.0)] {
            let bend = motion.axis_angle(elbow).y.to_degrees() * sign;
            assert!(
                (0.0..140.0).contains(&bend),
                "frame {k}: an elbow at {bend} degrees"
            );
        }
    }
}

#[test]
fn arms_hang_at_first_and_both_hands_gesture_later() {
    let skeleton = man();
    let clip = perform();
    for (shoulder, wrist) in [
        (Joint::LeftShoulder, Joint::LeftWrist),
        (Joint::RightShoulder, Joint::RightWrist),
    ] {
        let heights: Vec<f64> = clip
            .frames
            .iter()
            .map(|motion| {
                let world = person(&skeleton, motion);
                world[wrist.index()].0.y - world[shoulder.index()].0.y
            })
            .collect();
        assert!(
            heights[0] < -0.42,
            "{} hangs at {:.2} m",
            wrist.name(),
            heights[0]
        );
        let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!(
            highest > -0.3,
            "{} rises to {highest:.2} m only",
            wrist.name()
        );
    }
    let turn = |joint: Joint| {
        let angles = clip.frames.iter().map(|m| m.axis_angle(joint).length());
        angles.fold(0.0, f32::max)
    };
    for finger in [
        Joint::LeftIndex1,
        Joint::RightIndex2,
        Joint::RightThumb2,
        Joint::LeftPinky1,
    ] {
        assert!(turn(finger) > 0.15, "{} hardly moves", finger.name());
    }
    for joint in [Joint::LeftEye, Joint::Head, Joint::Spine2] {
        assert!(turn(joint) > 0.1, "{} hardly moves", joint.name());
    }
}

#[test]
fn the_face_uses_every_preset_it_has_and_talks_without_any() {
    let clip = perform();
    for (k, name) in NAMES.iter().enumerate() {
        let most = clip
            .frames
            .iter()
            .map(|m| m.expression()[k])
            .fold(0.0, f32::max);
        assert!((0.3..=1.0).contains(&most), "`{name}` reaches {most}");
    }
    let closed = clip
        .frames
        .iter()
        .filter(|m| m.expression()[0] > 0.8)
        .count();
    assert!(
        (6..80).contains(&closed),
        "the eyes are shut in {closed} of 540 frames"
    );
    let bare =
        MotionClip::built_in(&man(), &Expressions::new(), 30.0, 30.0).expect("a performance");
    let jaw = bare
        .frames
        .iter()
        .map(|m| m.axis_angle(Joint::Jaw).x)
        .fold(0.0, f32::max);
    assert!(
        jaw > 0.1,
        "a face without presets opens its jaw by {jaw} rad only"
    );
    assert!(
        bare.notes.iter().any(|note| note.contains("smile")),
        "absent presets are named: {:?}",
        bare.notes
    );
    assert_eq!(bare.frames.len(), 900, "thirty seconds at 30 frames");
    assert!((bare.duration() - 30.0).abs() < 1e-9, "thirty seconds");
}

#[test]
fn nonsense_lengths_and_rates_are_refused() {
    for (seconds, rate) in [
        (0.0, 30.0),
        (9.0, 0.0),
        (-9.0, -30.0),
        (f64::NAN, 30.0),
        (1e9, 1e9),
    ] {
        let got = MotionClip::built_in(&man(), &Expressions::new(), seconds, rate);
        assert!(
            matches!(got, Err(MotionError::Request(_))),
            "{seconds} s at {rate} frames per second"
        );
    }
}
