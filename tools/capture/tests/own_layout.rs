//! Our own layout: what is written is read again, and what is broken is refused by file and field.

use capture::{Camera, Capture, CaptureError, CaptureWriter, FramePose, HeldOut, Photograph};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use spmm3::{ExpressionBasis, Joint, MotionParams};
use std::path::Path;

fn cameras() -> Vec<Camera> {
    (0..3)
        .map(|k| Camera {
            name: format!("cam{k:02}"),
            size: [6 + k, 5],
            focal: [30.25, 31.5],
            centre: [3.1, 2.4],
            distortion: [0.0; 5],
            camera_from_world: DAffine3::from_rotation_translation(
                DQuat::from_rotation_y(f64::from(k)) * DQuat::from_rotation_x(0.1),
                DVec3::new(0.1, 1.2, 3.3),
            ),
        })
        .collect()
}

fn photograph(camera: &Camera, seed: u8) -> Photograph {
    let pixels = camera.size[0] as usize * camera.size[1] as usize;
    let noise = |k: usize| {
        u8::try_from(k * 37 % 251)
            .expect("a byte")
            .wrapping_mul(seed | 1)
    };
    Photograph {
        size: camera.size,
        rgb: (0..3 * pixels).map(noise).collect(),
        mask: Some((0..pixels).map(noise).collect()),
    }
}

fn poses(frames: usize) -> Vec<FramePose> {
    (0..frames)
        .map(|k| {
            let mut parameters = MotionParams::default();
            parameters.set_axis_angle(Joint::LeftElbow, Vec3::new(0.1, k as f32 * 0.2, -0.3));
            parameters.set_axis_angle(Joint::RightThumb2, Vec3::splat(0.25));
            parameters.expression_mut()[49] = 0.5;
            FramePose {
                parameters,
                pelvis: Vec3::new(0.5, 0.9, k as f32),
            }
        })
        .collect()
}

const FRAMES: usize = 4;

fn held_out() -> HeldOut {
    HeldOut {
        cameras: vec![1],
        frames: vec![0, 3],
    }
}

fn write(folder: &Path) -> Vec<Camera> {
    let cameras = cameras();
    let writer = CaptureWriter::create(folder, &cameras, FRAMES, 59.94)
        .expect("made")
        .with_expression_basis(Some(ExpressionBasis::MAKEHUMAN_1));
    for (k, camera) in cameras.iter().enumerate() {
        for frame in (0..FRAMES).rev() {
            let seed = u8::try_from(10 * k + frame).expect("small");
            writer
                .write(k, frame, &photograph(camera, seed))
                .expect("written");
        }
    }
    writer
        .finish(Some(&poses(FRAMES)), &held_out())
        .expect("finished");
    cameras
}

#[test]
fn what_the_writer_wrote_is_read_again_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let cameras = write(folder.path());
    let capture = Capture::open(folder.path()).expect("a capture");
    assert_eq!(capture.cameras(), cameras, "cameras");
    assert_eq!(capture.frames(), FRAMES, "frames");
    assert_eq!(capture.frame_rate(), 59.94, "rate");
    assert_eq!(capture.poses(), Some(poses(FRAMES).as_slice()), "poses");
    assert_eq!(capture.held_out(), &held_out(), "held out");
    assert_eq!(
        capture.expression_basis(),
        Some(&ExpressionBasis::MAKEHUMAN_1),
        "the face's basis"
    );
    for (k, camera) in cameras.iter().enumerate() {
        for frame in 0..FRAMES {
            let seed = u8::try_from(10 * k + frame).expect("small");
            let read = capture.photograph(k, frame).expect("a photograph");
            assert!(read == photograph(camera, seed), "camera {k} frame {frame}");
        }
    }
    assert!(capture.photograph(3, 0).is_err(), "no fourth camera");
    assert!(capture.photograph(0, FRAMES).is_err(), "no fifth frame");
}

#[test]
fn cameras_and_poses_are_rewritten_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut cameras = write(folder.path());
    let mut capture = Capture::open(folder.path()).expect("a capture");
    cameras[2].camera_from_world = DAffine3::from_translation(DVec3::new(0.5, -0.25, 4.0));
    let elsewhere = cameras[2].camera_from_world;
    capture.place(2, elsewhere).expect("a third camera");
    assert!(capture.place(3, elsewhere).is_err(), "no fourth camera");
    let mut bent = poses(FRAMES);
    bent[1].pelvis = Vec3::new(0.125, 1.5, -2.0);
    let mut broken = bent.clone();
    broken[0].pelvis.x = f32::NAN;
    for wrong in [bent[1..].to_vec(), broken] {
        assert!(capture.rewrite(wrong).is_err(), "other poses are refused");
    }
    let untouched = Capture::open(folder.path()).expect("a capture");
    assert_eq!(
        untouched.poses(),
        Some(poses(FRAMES).as_slice()),
        "as it was"
    );
    assert_ne!(untouched.cameras(), cameras, "as it was");
    capture.rewrite(bent.clone()).expect("written");
    assert_eq!(capture.poses(), Some(bent.as_slice()), "also of this one");
    let read = Capture::open(folder.path()).expect("a capture");
    assert_eq!(read.cameras(), cameras, "cameras");
    assert_eq!(read.poses(), Some(bent.as_slice()), "poses");
    assert_eq!(read.held_out(), &held_out(), "held out");
    assert_eq!(read.frame_rate(), 59.94, "rate");
    assert_eq!(
        read.expression_basis(),
        Some(&ExpressionBasis::MAKEHUMAN_1),
        "the face's basis"
    );
    let picture = read.photograph(1, 2).expect("a photograph");
    assert!(picture == photograph(&cameras[1], 12), "pictures");
}

#[test]
fn a_writing_that_was_broken_off_is_recognised_and_may_be_repeated() {
    let folder = tempfile::tempdir().expect("a folder");
    let cameras = cameras();
    let writer = CaptureWriter::create(folder.path(), &cameras, FRAMES, 30.0).expect("made");
    writer
        .write(0, 0, &photograph(&cameras[0], 1))
        .expect("written");
    drop(writer);
    let error = Capture::open(folder.path()).expect_err("not finished");
    assert!(matches!(error, CaptureError::Unfinished { .. }), "{error}");
    write(folder.path());
    Capture::open(folder.path()).expect("finished now");
    let again = CaptureWriter::create(folder.path(), &cameras, FRAMES, 30.0);
    assert!(again.is_err(), "a finished capture is not written over");
}

#[test]
fn what_others_put_into_the_folder_is_never_deleted() {
    let folder = tempfile::tempdir().expect("a folder");
    let cameras = cameras();
    let create = || CaptureWriter::create(folder.path(), &cameras, FRAMES, 30.0);
    for name in ["frames/holiday.jpg", "masks/carnival.txt", "motion.npz"] {
        let own = folder.path().join(name);
        std::fs::create_dir_all(own.parent().expect("a folder")).expect("made");
        std::fs::write(&own, "mine").expect("written");
        let said = create().expect_err("refused").to_string();
        let first = name.split('/').next().expect("a name");
        assert!(
            said.contains(first) && said.contains("name another folder"),
            "{name}: {said}"
        );
        assert_eq!(std::fs::read(&own).expect("still there"), b"mine", "{name}");
        let alone = folder.path().join(first);
        if alone.is_dir() {
            std::fs::remove_dir_all(alone).expect("gone");
        } else {
            std::fs::remove_file(alone).expect("gone");
        }
    }
    drop(create().expect("nothing is in its way"));
    write(folder.path());
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    assert_eq!(left.len(), 4, "no marker stays: {left:?}");
}
