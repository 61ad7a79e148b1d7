//! BVH files that the tests write: rigs of every family, mistakes with their line, and hostile text.

use crate::{man, reference::person};
use glam::{Quat, Vec3};
use proptest::prelude::*;
use spmm3::{Joint, LoadOptions, MotionClip, MotionError, MotionParams, Playback, Skeleton};
use std::fmt::Write;

/// Our own skeleton as a Mixamo file: (Mixamo's name, our joint) in tree order.
const MIXAMO: [(&str, Joint); 21] = [
    ("Hips", Joint::Pelvis),
    ("Spine", Joint::Spine1),
    ("Spine1", Joint::Spine2),
    ("Spine2", Joint::Spine3),
    ("Neck", Joint::Neck),
    ("Head", Joint::Head),
    ("LeftShoulder", Joint::LeftCollar),
    ("LeftArm", Joint::LeftShoulder),
    ("LeftForeArm", Joint::LeftElbow),
    ("LeftHand", Joint::LeftWrist),
    ("RightShoulder", Joint::RightCollar),
    ("RightArm", Joint::RightShoulder),
    ("RightForeArm", Joint::RightElbow),
    ("RightHand", Joint::RightWrist),
    ("LeftUpLeg", Joint::LeftHip),
    ("LeftLeg", Joint::LeftKnee),
    ("LeftFoot", Joint::LeftAnkle),
    ("RightUpLeg", Joint::RightHip),
    ("RightLeg", Joint::RightKnee),
    ("RightFoot", Joint::RightAnkle),
    ("RightToeBase", Joint::RightFoot),
];

/// How a test writes a file.
struct Style {
    units_per_metre: f32,
    /// z up, facing -y.
    z_up: bool,
    /// Axis letters of the rotation channels.
    order: &'static str,
    line_end: &'static str,
    prefix: &'static str,
}

const PLAIN: Style = Style {
    units_per_metre: 100.0,
    z_up: false,
    order: "ZXY",
    line_end: "\n",
    prefix: "mixamorig:",
};

impl Style {
    fn vector(&self, v: Vec3) -> Vec3 {
        if self.z_up {
            Vec3::new(v.x, -v.z, v.y)
        } else {
            v
        }
    }

    /// Euler angles in degrees of a rotation, in the style's order, by the definition of the product of three turns.
    fn angles(&self, q: Quat) -> [f32; 3] {
        let turned = self.vector(q.xyz());
        let q = Quat::from_xyzw(turned.x, turned.y, turned.z, q.w);
        let order = match self.order {
            "ZXY" => glam::EulerRot::ZXY,
            "XYZ" => glam::EulerRot::XYZ,
            "YZX" => glam::EulerRot::YZX,
            other => panic!("no order {other}"),
        };
        let (a, b, c) = q.to_euler(order);
        [a, b, c].map(f32::to_degrees)
    }

    fn write(&self, skeleton: &Skeleton, frames: &[MotionParams]) -> String {
        let mut text = String::from("HIERARCHY\n");
        self.joint(skeleton, Joint::Pelvis, &mut text);
        writeln!(text, "MOTION\nFrames:\t{}\nFrame Time: 4e-2", frames.len()).expect("text");
        for motion in frames {
            let mut row = Vec::new();
            let at = skeleton.rest_positions()[0] + motion.root_translation;
            row.extend((self.vector(at) * self.units_per_metre).to_array());
            for joint in Self::tree(Joint::Pelvis) {
                row.extend(self.angles(motion.rotation(joint)));
            }
            let words: Vec<_> = row.iter().map(|v| format!("{v:e}")).collect();
            writeln!(text, "{}", words.join(" ")).expect("text");
        }
        text.replace('\n', self.line_end)
    }

    /// The file's joints in the order that `joint` writes them.
    fn tree(joint: Joint) -> Vec<Joint> {
        let children = MIXAMO.iter().filter(|(_, j)| j.parent() == Some(joint));
        let below = children.flat_map(|(_, child)| Self::tree(*child));
        std::iter::once(joint).chain(below).collect()
    }

    fn joint(&self, skeleton: &Skeleton, joint: Joint, text: &mut String) {
        let (name, _) = MIXAMO
            .iter()
            .find(|(_, j)| *j == joint)
            .expect("a Mixamo joint");
        let root = joint == Joint::Pelvis;
        let offset = self.vector(skeleton.rest_offset(joint)) * self.units_per_metre;
        let rotations: Vec<_> = self.order.chars().map(|c| format!("{c}rotation")).collect();
        let (word, channels) = if root {
            (
                "ROOT",
                format!("6 Xposition Yposition Zposition {}", rotations.join(" ")),
            )
        } else {
            ("JOINT", format!("3 {}", rotations.join(" ")))
        };
        writeln!(
            text,
            "{word} {}{name}\n{{\n\tOFFSET {} {} {}\n\tCHANNELS {channels}",
            self.prefix, offset.x, offset.y, offset.z
        )
        .expect("text");
        let children: Vec<_> = MIXAMO
            .iter()
            .filter(|(_, j)| j.parent() == Some(joint))
            .collect();
        for (_, child) in &children {
            self.joint(skeleton, *child, text);
        }
        if children.is_empty() {
            text.push_str("End Site\n{\nOFFSET 0 1 0\n}\n");
        }
        text.push_str("}\n");
    }
}

fn read(text: &str) -> Result<MotionClip, MotionError> {
    MotionClip::from_bvh(text, &man(), &LoadOptions::default())
}

/// A pose with natural amounts of everything.
fn pose(angles: &[f32]) -> MotionParams {
    let mut motion = MotionParams::default();
    for (k, (_, joint)) in MIXAMO.iter().enumerate() {
        let limit = match joint {
            Joint::LeftElbow | Joint::RightElbow => {
                // A hinge, so that there is no twist for the forearm to share out.
                let sign = if *joint == Joint::LeftElbow {
                    -1.0
                } else {
                    1.0
                };
                motion.set_axis_angle(*joint, Vec3::Y * sign * angles[3 * k].abs() * 2.0);
                continue;
            }
            Joint::LeftWrist | Joint::RightWrist => 0.0,
            Joint::LeftShoulder | Joint::RightShoulder | Joint::LeftHip | Joint::RightHip => 1.2,
            _ => 0.5,
        };
        let v = Vec3::new(angles[3 * k], angles[3 * k + 1], angles[3 * k + 2]);
        motion.set_axis_angle(*joint, v * limit);
    }
    motion
}

/// Numbers that a BVH may hold, mostly far from a person's.
fn extreme() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -1e3f32..1e3,
        1 => -9.9e8f32..9.9e8,
        1 => prop::num::f32::NORMAL,
        1 => prop::sample::select(vec![3e38, -9.9e8, 9.9e8, 1e-38, -0.0, 1e-45]),
    ]
}

#[test]
fn a_root_too_far_away_is_refused_with_frame_and_value() {
    let skeleton = man();
    let mut frames = vec![MotionParams::default(); 2];
    frames[1].root_translation.x = 2e5;
    match read(&PLAIN.write(&skeleton, &frames)) {
        Err(MotionError::Range { frame, value, .. }) => {
            assert_eq!(frame, 1, "the second frame");
            assert!((value - 2e5).abs() < 10.0, "{value} m");
        }
        other => panic!("no range error: {other:?}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn our_own_skeleton_written_as_bvh_comes_back_as_it_was(
        angles in prop::collection::vec(-1.0f32..1.0, 63),
        style in 0usize..4,
    ) {
        let style = [
            PLAIN,
            Style { units_per_metre: 1.0, z_up: true, order: "XYZ", line_end: "\r\n", prefix: "" },
            Style { units_per_metre: 10.0, z_up: true, order: "YZX", line_end: "\n\n", prefix: "mixamorig1:" },
            Style { units_per_metre: 1.0 / 0.0254, z_up: false, order: "YZX", line_end: "\n", prefix: "" },
        ].into_iter().nth(style).expect("a style");
        let skeleton = man();
        let mut frames = vec![MotionParams::default(), pose(&angles)];
        frames[1].root_translation = Vec3::new(0.3, 0.02, -0.4);
        let clip = read(&style.write(&skeleton, &frames)).expect("a good file");
        let (got, expected) = (person(&skeleton, &clip.frames[1]), person(&skeleton, &frames[1]));
        let shift = got[0].0 - expected[0].0;
        for joint in Joint::ALL {
            let fingers = joint >= Joint::LeftIndex1;
            let j = joint.index();
            let angle = (got[j].1.transpose() * expected[j].1).to_cols_array();
            let cosine = ((angle[0] + angle[4] + angle[8]) - 1.0) / 2.0;
            // Fingers are not in the file and hang at ease instead.
            prop_assert!(fingers || cosine > 0.99999, "{} is turned {:.2} degrees away",
                joint.name(), cosine.clamp(-1.0, 1.0).acos().to_degrees());
            let away = (got[j].0 - expected[j].0 - shift).length();
            prop_assert!(fingers || away < 3e-3, "{} is {away} m away", joint.name());
        }
        prop_assert_eq!(&clip.unmapped, &Vec::<String>::new(), "every joint of Mixamo's is known");
        prop_assert_eq!(clip.unmapped_summary(), None, "and there is nothing to tell");
        let travelled = clip.frames[1].root_translation - clip.frames[0].root_translation;
        prop_assert!((travelled - frames[1].root_translation).length() < 3e-3, "travelled {travelled}");
    }

    #[test]
    fn extreme_finite_numbers_in_a_bvh_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), extreme()), 1..40),
        scale in prop::option::of(prop::num::f32::NORMAL),
    ) {
        let text = PLAIN.write(&man(), &[MotionParams::default(), MotionParams::default()]);
        let mut words: Vec<String> = text.split_inclusive(char::is_whitespace).map(str::to_owned).collect();
        // Offsets, frame time and motion values; counts are the other test's.
        let numbers: Vec<usize> = (0..words.len())
            .filter(|k| words[*k].trim().parse::<f32>().is_ok())
            .filter(|k| !words[k - 1].starts_with("CHANNELS") && !words[k - 1].starts_with("Frames"))
            .collect();
        for (at, value) in edits {
            let word = &mut words[numbers[at.index(numbers.len())]];
            let end = word.trim_end().len();
            word.replace_range(..end, &format!("{value:e}"));
        }
        let options = LoadOptions { bvh_scale: scale };
        if let Ok(clip) = MotionClip::from_bvh(&words.concat(), &man(), &options) {
            prop_assert!(clip.frames.iter().all(MotionParams::is_finite), "a frame is not finite");
        }
    }

    #[test]
    fn damaged_bvh_text_never_panics(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0usize..12, any::<u8>()), 1..12),
    ) {
        let mut bytes = PLAIN.write(&man(), &[MotionParams::default(), MotionParams::default()]).into_bytes();
        for (at, kind, byte) in edits {
            let at = at.index(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
            let words: [&[u8]; 10] = [b"}", b"{", b" JOINT Hips {", b" 1e38 ", b" -nan ", b" CHANNELS 12 ",
                b" 18446744073709551616 ", b"MOTION", b" End Site { ", b" 99999999999 "];
            match kind {
                0 => bytes.truncate(at),
                1 => if !bytes.is_empty() { bytes[at] = byte },
                k => { bytes.splice(at..at, words[k - 2].iter().copied()); }
            }
        }
        if let Ok(clip) = read(&String::from_utf8_lossy(&bytes)) {
            prop_assert!(clip.frames.iter().all(MotionParams::is_finite), "a frame is not finite");
        }
    }
}

#[test]
fn the_scale_option_takes_travel_as_it_stands() {
    let skeleton = man();
    let mut frames = vec![MotionParams::default(); 2];
    frames[1].root_translation = Vec3::new(1.0, 0.0, 0.5);
    let text = PLAIN.write(&skeleton, &frames);
    let options = LoadOptions {
        bvh_scale: Some(0.02),
    };
    let clip = MotionClip::from_bvh(&text, &skeleton, &options).expect("a good file");
    let travelled = clip.frames[1].root_translation - clip.frames[0].root_translation;
    assert!(
        (travelled - Vec3::new(2.0, 0.0, 1.0)).length() < 1e-3,
        "100 units of 2 cm are 2 m, not {travelled}"
    );
    for scale in [0.0, -1.0, f32::NAN] {
        let options = LoadOptions {
            bvh_scale: Some(scale),
        };
        assert!(
            matches!(
                MotionClip::from_bvh(&text, &skeleton, &options),
                Err(MotionError::Request(_))
            ),
            "a scale of {scale} is refused"
        );
    }
}

#[test]
fn mistakes_are_reported_with_their_line() {
    let good = PLAIN.write(&man(), &[MotionParams::default()]);
    let line_of = |what: &str| 1 + good.lines().position(|l| l.contains(what)).expect("a line");
    let last = good.lines().count();
    let cases = [
        (
            "no header",
            good.replacen("HIERARCHY", "HELLO", 1),
            1,
            "HIERARCHY",
        ),
        (
            "a bad channel",
            good.replacen("Zrotation", "Wrotation", 1),
            line_of("Zrotation"),
            "Wrotation",
        ),
        (
            "too many channels",
            good.replacen("CHANNELS 6", "CHANNELS 4000000000", 1),
            line_of("CHANNELS 6"),
            "4000000000",
        ),
        (
            "no frame time",
            good.replacen("4e-2", "0", 1),
            line_of("Frame Time"),
            "frame time of 0 s",
        ),
        (
            "no frames",
            good.replacen("Frames:\t1", "Frames: 0", 1),
            line_of("Frames:"),
            "no frames",
        ),
        (
            "fewer frames than said",
            good.replacen("Frames:\t1", "Frames: 2", 1),
            last,
            "ends after",
        ),
        (
            "more frames than said",
            format!("{good}1 2 3"),
            last + 1,
            "more numbers",
        ),
        (
            "not a number",
            format!("{}\n0 x", good.trim_end()),
            last + 1,
            "more numbers",
        ),
        (
            "an infinite offset",
            good.replacen("OFFSET 0 1 0", "OFFSET 0 inf 0", 1),
            line_of("OFFSET 0 1 0"),
            "inf",
        ),
    ];
    for (what, text, line, word) in cases {
        match read(&text) {
            Err(MotionError::Bvh { line: at, reason }) => {
                assert_eq!(at, line, "{what}: {reason}");
                assert!(
                    reason.contains(word) || what == "not a number",
                    "{what}: `{reason}` says nothing of `{word}`"
                );
            }
            other => panic!("{what}: {other:?}"),
        }
    }
}

#[test]
fn an_absurd_frame_time_is_refused_but_for_a_single_pose() {
    let file = |frames: usize, time: &str| {
        let frames = vec![MotionParams::default(); frames];
        let text = PLAIN.write(&man(), &frames);
        read(&text.replacen("4e-2", time, 1))
    };
    for (frames, time, word) in [
        (2000, "60", "60 s"),
        (2, "1.01", "1.01 s"),
        (2, "0.0009", "0.0009 s"),
        (1, "-1", "-1 s"),
        (1, "inf", "inf"),
        (1, "NaN", "NaN"),
        (1, "3601", "3601 s"),
        (3601, "1", "hours"),
        (2, "soon", "soon"),
    ] {
        match file(frames, time) {
            Err(MotionError::Bvh { reason, .. }) => assert!(reason.contains(word), "{reason}"),
            other => panic!("{frames} frames of {time} s: {other:?}"),
        }
    }
    for (frames, time) in [(2, "0.001"), (2, "1"), (1, "60"), (1, "1e-6"), (3600, "1")] {
        let clip = file(frames, time);
        assert!(clip.is_ok(), "{frames} frames of {time} s: {clip:?}");
    }
}

#[test]
fn a_claimed_billion_frames_is_refused_without_memory_for_them() {
    let text = PLAIN.write(&man(), &[MotionParams::default()]).replacen(
        "Frames:\t1",
        "Frames: 1000000000",
        1,
    );
    assert!(
        matches!(read(&text), Err(MotionError::TooLarge { .. })),
        "a billion frames are refused"
    );
}

#[test]
fn a_skeleton_of_unknown_names_is_refused_with_what_it_lacks() {
    let text = PLAIN
        .write(&man(), &[MotionParams::default()])
        .replace("UpLeg", "Oberschenkel");
    let error = read(&text).expect_err("no thighs").to_string();
    assert!(
        error.contains("left_hip") && error.contains("Mixamo") && error.contains("mixamorig:Hips"),
        "`{error}` names what is missing, known and found"
    );
}

#[test]
fn other_files_are_refused_with_a_hint() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases = [
        ("dance.fbx", "Kaydara FBX", "export"),
        ("poses.npy", "\u{93}NUMPY", "savez"),
    ];
    for (name, content, word) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("a file");
        let error = MotionClip::load(&path, &man(), &LoadOptions::default())
            .expect_err("no motion")
            .to_string();
        assert!(
            error.contains(name) && error.contains(word),
            "`{error}` names the file and what to do"
        );
    }
    let missing = folder.path().join("absent.bvh");
    let error = MotionClip::load(&missing, &man(), &LoadOptions::default()).expect_err("no file");
    assert!(
        matches!(error, MotionError::Read { .. }),
        "a missing file is a reading error: {error:?}"
    );
    assert_cause_is_printed_once(&error);
    let named_as_a_file = folder.path().join("walks.bvh");
    std::fs::create_dir(&named_as_a_file).expect("a folder");
    for path in [folder.path(), &named_as_a_file] {
        let error = MotionClip::load(path, &man(), &LoadOptions::default()).expect_err("a folder");
        assert!(
            matches!(&error, MotionError::Folder { path: named } if named == path),
            "{error:?}"
        );
    }
    let half = folder.path().join("half.npz");
    std::fs::write(&half, b"PK\x03\x04 and no more").expect("a file");
    let error = MotionClip::load(&half, &man(), &LoadOptions::default()).expect_err("half a file");
    assert_cause_is_printed_once(&error);
}

/// A program that prints the chain of causes would print it twice otherwise.
fn assert_cause_is_printed_once(error: &MotionError) {
    let cause = std::error::Error::source(error)
        .expect("a cause")
        .to_string();
    assert!(
        !error.to_string().contains(&cause),
        "`{error}` repeats its cause `{cause}`"
    );
}

#[test]
fn a_file_cannot_break_a_message_into_lines() {
    let text = PLAIN
        .write(&man(), &[MotionParams::default()])
        .replace("UpLeg", "Thigh\r\u{1b}[31m");
    let error = read(&text).expect_err("no thighs").to_string();
    assert!(!error.contains(char::is_control), "{error:?}");
}

#[test]
fn sampling_hits_the_frames_and_takes_the_short_way_between() {
    let skeleton = man();
    let mut frames = vec![MotionParams::default(); 3];
    let turn = |degrees: f32| Quat::from_rotation_y(degrees.to_radians());
    frames[0].set_rotation(Joint::Pelvis, turn(170.0));
    frames[1].set_rotation(Joint::Pelvis, turn(-170.0));
    frames[2].set_rotation(Joint::Pelvis, turn(-160.0));
    frames[2].root_translation = Vec3::new(1.0, 0.0, 0.0);
    let clip = read(&PLAIN.write(&skeleton, &frames)).expect("a good file");
    for (k, frame) in clip.frames.iter().enumerate() {
        let time = k as f64 * clip.frame_seconds;
        assert_eq!(clip.sample(time, Playback::Clamp), *frame, "frame {k}");
        let around = time + 7.0 * clip.duration();
        assert_eq!(
            clip.sample(around, Playback::Loop),
            *frame,
            "frame {k}, later round"
        );
    }
    let between = clip.sample(0.5 * clip.frame_seconds, Playback::Clamp);
    let angle = between.rotation(Joint::Pelvis).angle_between(turn(180.0));
    assert!(
        angle < 1e-3,
        "half way from 170 to -170 degrees is 180, not {angle} rad from it"
    );
    let past = clip.sample(100.0, Playback::Clamp);
    assert_eq!(past, clip.frames[2], "past the end the last frame holds");
    assert_eq!(
        clip.sample(f64::NAN, Playback::Loop),
        clip.frames[0],
        "no time is the beginning"
    );
    let mut before = clip.sample(0.0, Playback::Loop);
    for step in 1..=3000 {
        let now = clip.sample(f64::from(step) * 1e-4, Playback::Loop);
        let jump = now
            .rotation(Joint::Pelvis)
            .angle_between(before.rotation(Joint::Pelvis));
        assert!(jump < 0.01, "a jump of {jump} rad at step {step}");
        before = now;
    }
}
