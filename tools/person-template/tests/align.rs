//! Cameras that were turned, and what held-out pictures may change.

mod made_up;

use capture::{Capture, HeldOut};
use glam::{DAffine3, DQuat, DVec3};
use made_up::Scenario;
use person_template::{Aligned, TemplateOptions, align};
use scan_rig::body::BodyModel;
use std::path::Path;
use synthetic_person::real_files::makehuman;

const SCENARIO: Scenario = Scenario {
    cameras: 6,
    frames: 6,
    side: 200,
    noise: (0.006, 0.02),
};

/// The third camera is off by 1.3 degrees, the fifth, which is held out, by as much.
const OFF: DVec3 = DVec3::new(-0.012, 0.018, 0.005);

fn turned(capture: &mut Capture, camera: usize) {
    let before = capture.cameras()[camera].camera_from_world;
    let turn = DAffine3::from_quat(DQuat::from_scaled_axis(OFF));
    capture.place(camera, turn * before).expect("a camera");
}

/// The angle between where a camera looks and where it should, radians.
fn off(aligned: &Aligned, truth: &Capture, camera: usize) -> f64 {
    let truth = truth.cameras()[camera].camera_from_world.matrix3;
    let found = aligned.camera_from_world[camera].matrix3;
    DQuat::from_mat3(&(found * truth.transpose()))
        .to_scaled_axis()
        .length()
}

fn aligned(capture: &Capture, makehuman: &Path) -> Aligned {
    let options = TemplateOptions {
        frames: 4,
        ..TemplateOptions::default()
    };
    align(capture, makehuman, &options, &|_| ()).expect("aligned")
}

#[test]
fn turned_cameras_are_turned_back_and_held_out_ones_move_nothing_else() {
    let Some(makehuman) = makehuman() else { return };
    let model = BodyModel::load(&makehuman).expect("the package is whole");
    let folder = tempfile::tempdir().expect("a folder");
    let held_out = HeldOut {
        cameras: vec![4],
        frames: vec![2],
    };
    made_up::write(folder.path(), &model, SCENARIO, &held_out).expect("a capture");
    let truth = Capture::open(folder.path()).expect("it opens");
    let mut capture = truth.clone();
    turned(&mut capture, 2);
    let one = aligned(&capture, &makehuman);
    turned(&mut capture, 4);
    let both = aligned(&capture, &makehuman);
    for camera in 0..SCENARIO.cameras {
        let (one, both) = (off(&one, &truth, camera), off(&both, &truth, camera));
        println!(
            "camera {camera}: {:.2} and {:.2} mrad off",
            1e3 * one,
            1e3 * both
        );
        assert!(
            one.max(both) < 0.3 * OFF.length(),
            "camera {camera}: {one} and {both}"
        );
    }
    println!(
        "overlap {:.3}, {:.3} before",
        both.overlap, both.overlap_before
    );
    assert!(both.overlap > both.overlap_before + 0.01, "{both:?}");
    assert_eq!(one.poses, both.poses, "by cameras that are not held out");
    for camera in [0, 1, 2, 3, 5] {
        let poses = [&one, &both].map(|of| of.camera_from_world[camera]);
        assert_eq!(poses[0], poses[1], "camera {camera}");
    }
    let captured = truth.poses().expect("poses");
    assert_ne!(
        one.poses[2], captured[2],
        "a held-out frame has its own correction"
    );
}
