//! Folders in the layouts of published data sets, written by the test.

mod support;

use capture::Capture;
use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
use spmm3::{ExpressionBasis, Joint};
use std::fs;
use std::path::Path;
use support::{cut, edit, npz, png, said};

const SIZE: [u32; 2] = [8, 6];

/// A camera at (0, 0, -3) in a world whose y is down, as OpenCV has it: axes are the world's own.
fn opencv(name: &str, x: f64) -> String {
    format!(
        r#""{name}": {{"K": [10, 0, 4, 0, 11, 3, 0, 0, 1], "R": [1, 0, 0, 0, 1, 0, 0, 0, 1], "T": [{x}, 0, 3], "distCoeff": [0, 0, 0, 0, 0], "imgSize": [8, 6]}}"#
    )
}

/// SMPL-X's parameters of a person whose head is down in their own axes' y: y of the world is down.
fn smpl(path: &Path, frames: usize) {
    let row = |values: &[f32]| -> Vec<f32> {
        values
            .iter()
            .copied()
            .cycle()
            .take(values.len() * frames)
            .collect()
    };
    npz(
        path,
        &[
            (
                "global_orient",
                &[frames, 3],
                row(&[std::f32::consts::PI, 0.0, 0.0]),
            ),
            ("transl", &[frames, 3], row(&[0.1, 0.2, 0.3])),
            ("body_pose", &[frames, 63], row(&[0.05; 63])),
            ("jaw_pose", &[frames, 3], row(&[0.2, 0.0, 0.0])),
            ("expression", &[frames, 10], row(&[0.7; 10])),
            ("left_hand_pose", &[frames, 45], row(&[0.3; 45])),
            ("right_hand_pose", &[frames, 45], row(&[-0.3; 45])),
            ("betas", &[1, 10], vec![0.5; 10]),
        ],
    );
}

fn avatar_rex(folder: &Path) {
    for (k, name) in ["22010708", "22010710"].iter().enumerate() {
        // The second camera lacks frame 2.
        for frame in (0..4).filter(|frame| k == 0 || *frame != 2) {
            png(&folder.join(format!("{name}/{frame:08}.jpg")), SIZE, frame);
            png(
                &folder.join(format!("{name}/mask/pha/{frame:08}.jpg")),
                SIZE,
                2 * frame,
            );
        }
    }
    let text = format!(
        "{{{}, {}}}",
        opencv("22010708", 0.0),
        opencv("22010710", 0.5)
    );
    fs::write(folder.join("calibration_full.json"), text).expect("written");
    smpl(&folder.join("smpl_params.npz"), 4);
}

fn thuman(folder: &Path) {
    for name in ["cam00", "cam01"] {
        for frame in 0..3 {
            png(
                &folder.join(format!("images/{name}/{frame:08}.jpg")),
                SIZE,
                frame,
            );
            png(
                &folder.join(format!("masks/{name}/{frame:08}.jpg")),
                SIZE,
                frame,
            );
        }
    }
    let text = format!("{{{}, {}}}", opencv("cam00", 0.0), opencv("cam01", 0.5));
    fs::write(folder.join("calibration.json"), text).expect("written");
}

fn actors_hq(folder: &Path) {
    for name in ["Cam001", "Cam002"] {
        for frame in 5..8 {
            png(
                &folder.join(format!("4x/rgbs/{name}/{name}_rgb{frame:06}.jpg")),
                SIZE,
                frame,
            );
            png(
                &folder.join(format!("4x/masks/{name}/{name}_mask{frame:06}.png")),
                SIZE,
                frame,
            );
        }
    }
    // Upright in a world of y up, looking along -z: half a turn about x.
    let text = "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n\
        Cam001,8,6,3.141592653589793,0,0,0.5,1.25,3,1.25,1.5,0.5,0.55\n\
        Cam002,8,6,3.0,0,0,0.5,1.25,3,1.25,1.5,0.5,0.55\n";
    fs::write(folder.join("4x/calibration.csv"), text).expect("written");
}

#[test]
fn avatar_rex_is_read_with_its_gaps_and_turned_upright() {
    let folder = tempfile::tempdir().expect("a folder");
    avatar_rex(folder.path());
    let capture = Capture::open(folder.path()).expect("AvatarReX");
    assert_eq!(capture.frames(), 3, "frame 2 is left out");
    assert_eq!(capture.frame_rate(), 30.0, "as published");
    let notes = capture.notes().join("; ");
    for words in ["1 of 4 frames left out", "y down", "betas", "30 Hz"] {
        assert!(notes.contains(words), "{words} in {notes}");
    }
    // A point of the file's world (y down) at (0.2, -0.4, 1): 4 m before the first camera.
    let upright = DVec3::new(0.2, 0.4, -1.0);
    let pixel = capture.cameras()[0].project(upright).expect("before it");
    let expected = DVec2::new(10.0 * 0.2 / 4.0 + 4.5, 11.0 * -0.4 / 4.0 + 3.5);
    assert!(pixel.distance(expected) < 1e-9, "{pixel} for {expected}");
    let photograph = capture.photograph(1, 2).expect("the picture of number 3");
    assert!(
        photograph.mask.is_some() && photograph.rgb[0] == 3,
        "its own pixels"
    );
    let poses = capture.poses().expect("smpl_params.npz");
    assert_eq!(poses.len(), 3, "one for each frame that is left");
    let pose = &poses[0];
    assert!(
        pose.parameters.axis_angle(Joint::Pelvis).length() < 1e-6,
        "upright now"
    );
    assert_eq!(
        pose.parameters.axis_angle(Joint::RightThumb3),
        Vec3::splat(-0.3),
        "hands"
    );
    assert_eq!(pose.parameters.expression()[9], 0.7, "the face");
    // transl (0.1, 0.2, 0.3) and the mean body's pelvis, y and z turned.
    let expected = Vec3::new(0.1 + 0.0031, 0.3514 - 0.2, -0.3 - 0.012);
    assert!(
        pose.pelvis.distance(expected) < 1e-5,
        "{} for {expected}",
        pose.pelvis
    );
    assert_eq!(
        capture.expression_basis(),
        Some(&ExpressionBasis::FLAME_2020),
        "SMPL-X's"
    );
}

#[test]
fn thuman_is_read_without_motion() {
    let folder = tempfile::tempdir().expect("a folder");
    thuman(folder.path());
    let capture = Capture::open(folder.path()).expect("THuman4.0");
    assert_eq!(
        (capture.frames(), capture.cameras().len()),
        (3, 2),
        "all of it"
    );
    assert!(
        capture.poses().is_none() && capture.has_masks(1),
        "masks, no motion"
    );
    // Turned by where the cameras' up is: y down.
    assert!(
        capture
            .notes()
            .iter()
            .any(|note| note.contains("by the cameras: y down")),
        "said"
    );
}

#[test]
fn actors_hq_is_read_as_humanrf_reads_it() {
    let folder = tempfile::tempdir().expect("a folder");
    actors_hq(folder.path());
    let capture = Capture::open(folder.path()).expect("ActorsHQ");
    assert_eq!(
        (capture.frames(), capture.frame_rate()),
        (3, 25.0),
        "frames 5 to 7 at 25 Hz"
    );
    let camera = &capture.cameras()[1];
    // By the data set's definition, written apart: world = R * camera + t.
    let world_from_camera = DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(3.0),
        DVec3::new(0.5, 1.25, 3.0),
    );
    let point = world_from_camera.transform_point3(DVec3::new(0.3, -0.2, 2.0));
    let pixel = camera.project(point).expect("before it");
    let expected = DVec2::new(8.0 * (1.25 * 0.15 + 0.5), 6.0 * (1.5 * -0.1 + 0.55));
    assert!(pixel.distance(expected) < 1e-9, "{pixel} for {expected}");
    assert_eq!(
        capture.photograph(0, 0).expect("a picture").rgb[0],
        5,
        "number 5 comes first"
    );
}

#[test]
fn broken_data_sets_are_refused_by_file_and_field() {
    type Way = (fn(&Path), fn(&Path), &'static [&'static str]);
    let ways: [Way; 16] = [
        (
            avatar_rex,
            |f| edit(&f.join("calibration_full.json"), "\"K\"", "\"k\""),
            &["calibration_full.json", "22010708.K", "missing"],
        ),
        (
            avatar_rex,
            |f| edit(&f.join("calibration_full.json"), "[0.5, 0, 3]", "[0.5, 0]"),
            &["22010710.T", "3 are needed"],
        ),
        (
            avatar_rex,
            |f| {
                edit(
                    &f.join("calibration_full.json"),
                    "[1, 0, 0, 0, 1, 0, 0, 0, 1]",
                    "[1, 0, 0, 0, 1, 0, 0, 0, 2]",
                );
            },
            &["22010708.R", "rotation"],
        ),
        (
            avatar_rex,
            |f| edit(&f.join("calibration_full.json"), "[10, 0, 4", "[10, 3, 4"),
            &["22010708.K", "skew"],
        ),
        (
            avatar_rex,
            |f| {
                edit(
                    &f.join("calibration_full.json"),
                    "[0, 0, 0, 0, 0]",
                    "[0, 0, 0, 0, 0, 1]",
                );
            },
            &["distCoeff"],
        ),
        (
            avatar_rex,
            |f| {
                edit(
                    &f.join("calibration_full.json"),
                    "\"imgSize\": [8, 6]",
                    "\"imgSize\": [8]",
                );
            },
            &["22010708.imgSize"],
        ),
        (
            avatar_rex,
            |f| {
                edit(
                    &f.join("calibration_full.json"),
                    "\"T\": [0,",
                    "\"T\": [NaN,",
                );
            },
            &["calibration_full.json", "line 1"],
        ),
        (
            avatar_rex,
            |f| fs::remove_dir_all(f.join("22010710")).expect("gone"),
            &["22010710"],
        ),
        (
            avatar_rex,
            |f| smpl(&f.join("smpl_params.npz"), 2),
            &["smpl_params.npz", "has 2 frames"],
        ),
        (
            avatar_rex,
            |f| cut(&f.join("22010708/00000000.jpg"), 60),
            &["22010708/00000000.jpg"],
        ),
        (
            thuman,
            |f| fs::remove_dir_all(f.join("images/cam01")).expect("gone"),
            &["images/cam01"],
        ),
        (
            thuman,
            |f| png(&f.join("masks/cam00/00000001.jpg"), [3, 3], 0),
            &["masks/cam00/00000001.jpg", "3 x 3"],
        ),
        (
            actors_hq,
            |f| edit(&f.join("4x/calibration.csv"), ",fy", ",f"),
            &["calibration.csv", "`fy`", "missing"],
        ),
        (
            actors_hq,
            |f| edit(&f.join("4x/calibration.csv"), "3.0,0,0", "nan,0,0"),
            &["line 3 rx", "nan"],
        ),
        (
            actors_hq,
            |f| edit(&f.join("4x/calibration.csv"), "Cam002", "Cam001"),
            &["line 3 name"],
        ),
        (
            actors_hq,
            |f| edit(&f.join("4x/calibration.csv"), "Cam001,8,6", "Cam001,0,6"),
            &["line 2 w, h"],
        ),
    ];
    for (k, (write, broken, words)) in ways.into_iter().enumerate() {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path());
        broken(folder.path());
        let said = said(folder.path());
        for word in words {
            assert!(said.contains(word), "way {k}, {word}: {said}");
        }
    }
}
