//! SMPL-X and AMASS archives that the tests write.

use crate::{man, reference::person};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use spmm3::{Expressions, Joint, LoadOptions, MotionClip, MotionError, MotionParams};
use std::io::{Cursor, Write};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// How an array is stored.
#[derive(Clone, Copy)]
enum Kind {
    F32,
    F64,
    /// Column-major, big-endian.
    FortranF64,
}

fn npy(shape: &[usize], values: &[f64], kind: Kind) -> Vec<u8> {
    let dims: Vec<_> = shape.iter().map(|d| format!("{d},")).collect();
    let (descr, fortran) = match kind {
        Kind::F32 => ("<f4", "False"),
        Kind::F64 => ("<f8", "False"),
        Kind::FortranF64 => (">f8", "True"),
    };
    let mut header = format!(
        "{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': ({}), }}",
        dims.join(" ")
    );
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).expect("short").to_le_bytes());
    bytes.extend(header.bytes());
    match kind {
        Kind::F32 => bytes.extend(values.iter().flat_map(|v| {
            #[allow(
                clippy::cast_possible_truncation,
                reason = "the format is single precision"
            )]
            let v = *v as f32;
            v.to_le_bytes()
        })),
        Kind::F64 => bytes.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        Kind::FortranF64 => {
            let columns: usize = shape.iter().skip(1).product();
            for column in 0..columns {
                for row in values.chunks_exact(columns) {
                    bytes.extend(row[column].to_be_bytes());
                }
            }
        }
    }
    bytes
}

/// Zeros in two bytes each.
fn half_precision(shape: &[usize]) -> Vec<u8> {
    let mut bytes = npy(shape, &[], Kind::F32);
    let descr = bytes.windows(3).position(|w| w == b"<f4");
    bytes[descr.expect("a type") + 2] = b'2';
    bytes.extend(vec![0; 2 * shape.iter().product::<usize>()]);
    bytes
}

fn archive(members: &[(&str, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(format!("{name}.npy"), options)
            .expect("a member");
        zip.write_all(bytes).expect("bytes");
    }
    zip.finish().expect("an archive").into_inner()
}

/// 165 pose values of three frames, small enough that a vector is its own shortest form.
fn poses(width: usize) -> Vec<f64> {
    (0..3 * width)
        .map(|k| 0.2 * (k as f64 * 0.7).sin())
        .collect()
}

fn read(bytes: &[u8]) -> Result<MotionClip, MotionError> {
    MotionClip::from_npz(bytes, &man())
}

/// Standing upright: the root's rotation would otherwise decide the way up.
fn upright(width: usize) -> Vec<f64> {
    let mut values = poses(width);
    for row in values.chunks_exact_mut(width) {
        row[..3].fill(0.0);
    }
    values
}

fn assert_joint(clip: &MotionClip, frame: usize, joint: Joint, expected: &[f64]) {
    let got = clip.frames[frame].axis_angle(joint).as_dvec3();
    let expected = DVec3::from_slice(expected);
    assert!(
        got.distance(expected) < 1e-5,
        "frame {frame} {}: {got} where the file has {expected}",
        joint.name()
    );
}

#[test]
fn smplx_poses_arrive_joint_by_joint_in_every_number_format() {
    let values = upright(165);
    for (kind, method) in [
        (Kind::F32, CompressionMethod::Stored),
        (Kind::F64, CompressionMethod::Deflated),
        (Kind::FortranF64, CompressionMethod::Stored),
    ] {
        let bytes = archive(&[("poses", npy(&[3, 165], &values, kind))], method);
        let clip = read(&bytes).expect("a good archive");
        assert_eq!(clip.frames.len(), 3, "three frames");
        for frame in 0..3 {
            for joint in Joint::ALL {
                let at = frame * 165 + joint.index() * 3;
                assert_joint(&clip, frame, joint, &values[at..at + 3]);
            }
        }
    }
}

#[test]
fn shorter_poses_go_to_the_joints_they_name() {
    let cases: [(usize, Joint, usize); 5] = [
        (156, Joint::LeftIndex1, 66),
        (75, Joint::RightEye, 72),
        (72, Joint::RightWrist, 63),
        (66, Joint::RightWrist, 63),
        (63, Joint::RightWrist, 60),
    ];
    for (width, joint, at) in cases {
        let values = upright(width);
        let bytes = archive(
            &[("poses", npy(&[3, width], &values, Kind::F64))],
            CompressionMethod::Stored,
        );
        let clip = read(&bytes).expect("a good archive");
        assert_joint(&clip, 1, joint, &values[width + at..width + at + 3]);
    }
}

#[test]
fn amass_stands_up_from_z_to_y() {
    let mut values = vec![0.0; 2 * 156];
    // AMASS: a quarter turn about x stands SMPL's y-up body on z.
    for row in values.chunks_exact_mut(156) {
        row[0] = std::f64::consts::FRAC_PI_2;
    }
    let trans = [0.0, 0.0, 1.3, 0.5, -2.0, 1.3];
    let bytes = archive(
        &[
            ("poses", npy(&[2, 156], &values, Kind::F64)),
            ("trans", npy(&[2, 3], &trans, Kind::F64)),
            ("mocap_framerate", npy(&[], &[120.0], Kind::F64)),
            ("betas", npy(&[16], &[0.0; 16], Kind::F64)),
        ],
        CompressionMethod::Deflated,
    );
    let clip = read(&bytes).expect("a good archive");
    assert!(
        (clip.frame_seconds - 1.0 / 120.0).abs() < 1e-9,
        "120 frames per second"
    );
    let skeleton = man();
    let world = person(&skeleton, &clip.frames[0]);
    let up = world[Joint::Head.index()].0 - world[Joint::Pelvis.index()].0;
    assert!(
        up.normalize().y > 0.999,
        "the head is above the hips, not at {up}"
    );
    let travelled = clip.frames[1].root_translation - clip.frames[0].root_translation;
    assert!(
        (travelled - Vec3::new(0.5, 0.0, 2.0)).length() < 1e-4,
        "travel turns along: {travelled}"
    );
    assert!(
        clip.frames[0].root_translation.y.abs() < 1e-3,
        "the soles are on the floor"
    );
}

#[test]
fn split_keys_of_a_fit_are_read_with_expression_and_one_frame_for_all() {
    let body = upright(63);
    let jaw = [0.2, 0.0, 0.0];
    let hand = poses(45);
    let expression: Vec<f64> = (0..30).map(|k| f64::from(k) * 0.1).collect();
    let bytes = archive(
        &[
            ("body_pose", npy(&[3, 21, 3], &body, Kind::F32)),
            ("global_orient", npy(&[3, 3], &[0.0; 9], Kind::F32)),
            ("jaw_pose", npy(&[1, 3], &jaw, Kind::F32)),
            ("right_hand_pose", npy(&[3, 45], &hand, Kind::F32)),
            ("left_hand_pose", npy(&[3, 6], &[0.5; 18], Kind::F32)),
            ("expression", npy(&[3, 10], &expression, Kind::F32)),
            ("transl", npy(&[3, 3], &[0.0; 9], Kind::F32)),
        ],
        CompressionMethod::Stored,
    );
    let clip = read(&bytes).expect("a good archive");
    assert_joint(&clip, 2, Joint::LeftKnee, &body[2 * 63 + 9..2 * 63 + 12]);
    assert_joint(&clip, 2, Joint::Jaw, &jaw);
    assert_joint(&clip, 1, Joint::RightThumb3, &hand[45 + 42..90]);
    assert!(
        (clip.frames[2].expression()[9] - 2.9).abs() < 1e-5
            && clip.frames[2].expression()[10] == 0.0,
        "ten expression coefficients"
    );
    assert!(
        clip.notes.iter().any(|note| note.contains("PCA")),
        "a hand of PCA coefficients is named: {:?}",
        clip.notes
    );
}

#[test]
fn mistakes_are_reported_with_the_array() {
    type Members = Vec<(&'static str, Vec<u8>)>;
    let cases: [(&str, Members, &str); 9] = [
        (
            "no poses",
            vec![("foo", npy(&[1], &[0.0], Kind::F64))],
            "body_pose",
        ),
        (
            "odd width",
            vec![("poses", npy(&[2, 7], &[0.0; 14], Kind::F64))],
            "[2, 7]",
        ),
        (
            "not a number",
            vec![("poses", npy(&[1, 63], &[f64::NAN; 63], Kind::F64))],
            "not a finite",
        ),
        (
            "a claim of much",
            vec![("poses", npy(&[1 << 40, 165], &[0.0; 165], Kind::F64))],
            "larger",
        ),
        (
            "nothing of an absurd width",
            vec![("poses", npy(&[0, 1 << 40, 1 << 40], &[], Kind::F64))],
            "larger",
        ),
        (
            "an expression of no frames and an absurd width",
            vec![
                ("poses", npy(&[1, 63], &[0.0; 63], Kind::F64)),
                ("expression", npy(&[0, 1 << 40, 1 << 40], &[], Kind::F64)),
            ],
            "larger",
        ),
        (
            "more numbers than the longest clip has, however small",
            vec![("poses", half_precision(&[200_001, 165]))],
            "larger",
        ),
        (
            "a claim of more",
            vec![("poses", npy(&[100, 165], &[0.0; 165], Kind::F64))],
            "bytes",
        ),
        (
            "frames that differ",
            vec![
                ("poses", npy(&[3, 63], &[0.0; 189], Kind::F64)),
                ("trans", npy(&[2, 3], &[0.0; 6], Kind::F64)),
            ],
            "2 frames",
        ),
    ];
    for (what, members, word) in cases {
        let error = read(&archive(&members, CompressionMethod::Stored))
            .expect_err(what)
            .to_string();
        assert!(
            error.contains(word),
            "{what}: `{error}` says nothing of {word}"
        );
    }
    assert!(
        matches!(
            read(b"PK\x03\x04 and no more"),
            Err(MotionError::Archive(_))
        ),
        "half an archive is refused"
    );
}

#[test]
fn an_absurd_frame_rate_is_refused_with_its_key_but_for_a_single_pose() {
    let file = |frames: usize, rate: Option<(&str, f64)>| {
        let poses = npy(&[frames, 63], &vec![0.0; frames * 63], Kind::F32);
        let mut members = vec![("poses", poses)];
        members.extend(rate.map(|(key, rate)| (key, npy(&[], &[rate], Kind::F64))));
        read(&archive(&members, CompressionMethod::Deflated))
    };
    for (frames, rate, key) in [
        (2, Some(("fps", 0.9)), "fps"),
        (2, Some(("mocap_framerate", 1001.0)), "mocap_framerate"),
        (1, Some(("fps", 0.0)), "fps"),
        (1, Some(("fps", -30.0)), "fps"),
        (3601, Some(("fps", 1.0)), "fps"),
        (108_001, None, "mocap_framerate"),
    ] {
        match file(frames, rate) {
            Err(MotionError::Array { array, reason }) => assert_eq!(array, key, "{reason}"),
            other => panic!("{frames} frames, {rate:?}: {:?}", other.map(|c| c.notes)),
        }
    }
    for (frames, rate) in [
        (2, Some(("fps", 1000.0))),
        (2, Some(("fps", 1.0))),
        (1, Some(("fps", 0.01))),
        (108_000, None),
    ] {
        let notes = file(frames, rate).map(|c| c.notes);
        assert!(notes.is_ok(), "{frames} frames, {rate:?}: {notes:?}");
    }
}

#[test]
fn a_bvh_scale_is_refused_where_there_is_no_bvh() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.npz");
    let poses = npy(&[3, 63], &upright(63), Kind::F32);
    std::fs::write(
        &path,
        archive(&[("poses", poses)], CompressionMethod::Stored),
    )
    .expect("a file");
    let load = |bvh_scale| MotionClip::load(&path, &man(), &LoadOptions { bvh_scale });
    assert!(load(None).is_ok(), "without a scale the file is good");
    let error = load(Some(0.01)).expect_err("a scale that does nothing");
    assert!(
        matches!(error, MotionError::Request(_)) && error.to_string().contains("walk.npz"),
        "{error:?}"
    );
}

#[test]
fn what_the_clip_writes_is_amass_and_comes_back() {
    let skeleton = man();
    let mut clip = MotionClip::built_in(&skeleton, &Expressions::new(), 1.0, 25.0)
        .expect("the built-in motion");
    for (k, frame) in clip.frames.iter_mut().enumerate() {
        for (at, value) in frame.values_mut().iter_mut().enumerate() {
            *value += 0.002 * (((at * 7 + k) % 11) as f32 - 5.0);
        }
        frame.root_translation += Vec3::new(0.0, 0.0, 0.01 * k as f32);
    }
    let bytes = clip.to_npz(&skeleton).expect("an archive");
    let read = read(&bytes).expect("it is read");
    assert_eq!(read.frames.len(), clip.frames.len());
    assert!(
        (read.frame_seconds - clip.frame_seconds).abs() < 1e-9,
        "the rate"
    );
    assert!(
        read.notes.iter().any(|note| note.contains("AMASS")),
        "{:?}",
        read.notes
    );
    let travel = |clip: &MotionClip, k: usize| {
        clip.frames[k].root_translation - clip.frames[0].root_translation
    };
    for (k, (a, b)) in read.frames.iter().zip(&clip.frames).enumerate() {
        for (a, b) in a.values().iter().zip(b.values()) {
            assert!((a - b).abs() < 2e-6, "frame {k}: {a} for {b}");
        }
        // The reader finds the floor under the soles for itself.
        let away = (travel(&read, k) - travel(&clip, k)) * Vec3::new(1.0, 0.0, 1.0);
        assert!(away.length() < 1e-5, "frame {k}: {away}");
    }
}

#[test]
fn a_header_of_nested_brackets_is_an_error_and_no_overflow() {
    let mut bytes = b"\x93NUMPY\x02\x00".to_vec();
    let header = vec![b'('; 60_000];
    bytes.extend(60_000u32.to_le_bytes());
    bytes.extend(header);
    let error = read(&archive(&[("poses", bytes)], CompressionMethod::Deflated));
    assert!(matches!(error, Err(MotionError::Array { .. })), "{error:?}");
}

/// An AMASS archive, z up, of `poses` and `trans`.
fn amass(width: usize, poses: &[f64], trans: &[f64]) -> Vec<u8> {
    let frames = poses.len() / width;
    archive(
        &[
            ("poses", npy(&[frames, width], poses, Kind::F32)),
            ("trans", npy(&[frames, 3], trans, Kind::F32)),
            ("mocap_framerate", npy(&[], &[120.0], Kind::F64)),
        ],
        CompressionMethod::Stored,
    )
}

#[test]
fn impossible_numbers_are_refused_with_frame_and_value() {
    let far = |poses: &[f64], trans: &[f64]| match read(&amass(156, poses, trans)) {
        Err(error @ MotionError::Range { frame, value, .. }) => (frame, value, error.to_string()),
        other => panic!("no range error: {other:?}"),
    };
    let still = vec![0.0; 3 * 156];
    // Large enough that turning z up to y up overflows.
    let (frame, value, text) = far(&still, &[3e38; 9]);
    assert_eq!((frame, value), (0, 3e38), "the first frame: {text}");
    assert!(text.contains("3e38") && text.contains("root"), "{text}");
    let mut trans = [0.0; 9];
    trans[5] = -10_001.0;
    let (frame, value, text) = far(&still, &trans);
    assert_eq!((frame, value), (1, -10_001.0), "the second frame: {text}");
    let mut poses = still;
    poses[2 * 156 + 3] = 2e19;
    let (frame, value, text) = far(&poses, &[0.0; 9]);
    assert_eq!((frame, value), (2, 2e19), "the third frame: {text}");
    assert!(text.contains("left_hip"), "{text}");
}

/// Any finite number of single precision, most often a large, a tiny or an ordinary one.
fn extreme() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -1.0f64..1.0,
        1 => -2e4f64..2e4,
        1 => prop::num::f32::NORMAL.prop_map(f64::from),
        1 => prop::sample::select(vec![3e38, -3e38, 1.9e19, -1e9, 1e-38, -0.0, 1e-45, 1e4, -1e4]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn extreme_finite_numbers_never_panic(
        (poses, trans, expression, rate) in (
            prop::collection::vec(extreme(), 2 * 63),
            prop::collection::vec(extreme(), 2 * 3),
            prop::collection::vec(extreme(), 2 * 10),
            extreme(),
        ),
        (tame_poses, tame_trans, tame_expression, tame_rate) in any::<(bool, bool, bool, bool)>(),
        amass in any::<bool>(),
    ) {
        // Each array by itself as well: one refused array would hide what the others do further on.
        let pick = |tame: bool, values: Vec<f64>| if tame { vec![0.1; values.len()] } else { values };
        let rate_name = if amass { "mocap_framerate" } else { "fps" };
        let members = [
            ("poses", npy(&[2, 63], &pick(tame_poses, poses), Kind::F32)),
            ("trans", npy(&[2, 3], &pick(tame_trans, trans), Kind::F32)),
            ("expression", npy(&[2, 10], &pick(tame_expression, expression), Kind::F32)),
            (rate_name, npy(&[], &[if tame_rate { 30.0 } else { rate }], Kind::F64)),
        ];
        if let Ok(clip) = read(&archive(&members, CompressionMethod::Stored)) {
            prop_assert!(clip.frames.iter().all(MotionParams::is_finite), "a frame is not finite");
        }
    }

    #[test]
    fn damaged_archives_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in proptest::option::weighted(0.2, any::<prop::sample::Index>()),
        deflate in any::<bool>(),
    ) {
        let method = if deflate { CompressionMethod::Deflated } else { CompressionMethod::Stored };
        let members = [
            ("poses", npy(&[3, 63], &upright(63), Kind::F32)),
            ("trans", npy(&[3, 3], &[0.0; 9], Kind::FortranF64)),
            ("mocap_framerate", npy(&[], &[30.0], Kind::F64)),
        ];
        let mut bytes = archive(&members, method);
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(clip) = read(&bytes) {
            prop_assert!(clip.frames.iter().all(MotionParams::is_finite), "a frame is not finite");
        }
    }

    #[test]
    fn damaged_array_headers_never_panic(
        edits in prop::collection::vec((0usize..200, any::<u8>()), 1..6),
    ) {
        // Damage inside the member, under a checksum that fits: the array reader itself has to cope.
        let mut poses = npy(&[3, 63], &upright(63), Kind::F32);
        for (at, byte) in edits {
            poses[at] = byte;
        }
        if let Ok(clip) = read(&archive(&[("poses", poses)], CompressionMethod::Stored)) {
            prop_assert!(clip.frames.iter().all(MotionParams::is_finite), "a frame is not finite");
        }
    }
}
