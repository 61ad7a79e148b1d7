//! Folders in the layouts of published data sets, written by the test.

mod support;

use capture::Capture;
use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
use spmm3::{ExpressionBasis, Joint};
use std::fs;
use support::png;
use support::published::{actors_hq, avatar_rex, thuman};

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
fn frames_come_in_the_order_of_their_numbers_however_they_are_named_and_written() {
    let folder = tempfile::tempdir().expect("a folder");
    avatar_rex(folder.path());
    thuman(folder.path());
    // Without padding, so that names sort otherwise than numbers, and written out of order.
    let numbers = [10, 2, 9, 11, 1];
    let renew = |of: &str| {
        let of = folder.path().join(of);
        for entry in fs::read_dir(&of).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_file() {
                fs::remove_file(path).expect("gone");
            }
        }
        for number in numbers {
            png(&of.join(format!("{number}.jpg")), [8, 6], number);
        }
    };
    fs::remove_file(folder.path().join("smpl_params.npz")).expect("gone");
    for camera in ["22010708", "22010710"] {
        renew(camera);
        renew(&format!("{camera}/mask/pha"));
    }
    for kind in ["images", "masks"] {
        renew(&format!("{kind}/cam00"));
        renew(&format!("{kind}/cam01"));
    }
    let seen = || -> Vec<u8> {
        let capture = Capture::open(folder.path()).expect("a capture");
        let frames = 0..capture.frames();
        frames
            .map(|frame| capture.photograph(1, frame).expect("a picture").rgb[0])
            .collect()
    };
    assert_eq!(seen(), [1, 2, 9, 10, 11], "AvatarReX");
    fs::remove_file(folder.path().join("calibration_full.json")).expect("gone");
    assert_eq!(seen(), [1, 2, 9, 10, 11], "THuman4.0");

    let folder = tempfile::tempdir().expect("a folder");
    actors_hq(folder.path());
    for camera in ["Cam001", "Cam002"] {
        for (kind, name, ending) in [("rgbs", "rgb", "jpg"), ("masks", "mask", "png")] {
            let of = folder.path().join(format!("4x/{kind}/{camera}"));
            fs::remove_dir_all(&of).expect("gone");
            for number in numbers {
                png(
                    &of.join(format!("{camera}_{name}{number}.{ending}")),
                    [8, 6],
                    number,
                );
            }
        }
    }
    let capture = Capture::open(folder.path()).expect("ActorsHQ");
    let first = (0..5).map(|frame| capture.photograph(0, frame).expect("a picture").rgb[0]);
    assert_eq!(first.collect::<Vec<_>>(), [1, 2, 9, 10, 11], "ActorsHQ");
}
