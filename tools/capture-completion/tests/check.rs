//! What is said of a capture whose faults are known.

mod common;

use capture_completion::check::{Shown, measured, report};
use common::{cameras, poses, seen};
use glam::{DAffine3, DMat3};
use motion_fit::landmarks::blazepose::{LOWER, mirrored};
use spmm3::{Joint, Skeleton};
use synthetic_person::{Puppet, PuppetSize};

#[test]
fn a_late_camera_and_a_wrong_one_are_told_from_those_that_take_left_for_right() {
    let skeleton = Puppet::new(PuppetSize::SMALL).avatar().skeleton;
    let (cameras, poses) = (cameras(), poses(&skeleton));
    let shown = |late: usize, turned: f64| -> Vec<Vec<Shown>> {
        (cameras.iter().enumerate())
            .map(|(k, camera)| {
                let mut lens = camera.clone();
                if k == 3 {
                    // Somebody bumped into its tripod.
                    lens.camera_from_world = DAffine3::from_mat3(DMat3::from_rotation_y(turned))
                        * lens.camera_from_world;
                }
                (0..poses.len())
                    .map(|frame| {
                        let at = if k == 1 {
                            frame.saturating_sub(late)
                        } else {
                            frame
                        };
                        let mut body = seen(&lens, &skeleton, &poses[at]);
                        if k == 2 && frame % 3 == 0 {
                            let own = body.points;
                            for (landmark, point) in body.points.iter_mut().enumerate().take(LOWER)
                            {
                                *point = own[mirrored(landmark)];
                            }
                        }
                        Shown {
                            landmarks: Some(body),
                            mask: None,
                        }
                    })
                    .collect()
            })
            .collect()
    };
    let good = report(&cameras, &shown(0, 0.0), &poses, &skeleton);
    assert_eq!(good.findings, Vec::<String>::new(), "nothing is wrong");
    for camera in &good.cameras {
        let error = camera.error_px.expect("compared");
        assert!(error < 0.01, "{} is off by {error} px", camera.name);
    }
    let late = report(&cameras, &shown(2, 0.0), &poses, &skeleton);
    assert_eq!(late.cameras[1].lag, 2, "two frames");
    assert!(
        late.findings.len() == 1 && late.findings[0].contains("`cam1` is 2 frames late"),
        "{:?}",
        late.findings
    );
    let bumped = report(&cameras, &shown(0, 0.03), &poses, &skeleton);
    assert!(
        bumped.findings.len() == 1 && bumped.findings[0].contains("`cam3` is off by"),
        "{:?}",
        bumped.findings
    );
}

#[test]
fn a_skeleton_is_measured_by_what_several_cameras_saw() {
    let skeleton = Puppet::new(PuppetSize::SMALL).avatar().skeleton;
    let taller = Skeleton::new(skeleton.rest_positions().map(|p| p * 1.1)).expect("in range");
    let (cameras, poses) = (cameras(), poses(&taller));
    let shown: Vec<Vec<Shown>> = (cameras.iter())
        .map(|camera| {
            (poses.iter().take(6))
                .map(|pose| Shown {
                    landmarks: Some(seen(camera, &taller, pose)),
                    mask: None,
                })
                .collect()
        })
        .collect();
    let found = measured(&skeleton, &cameras, &shown);
    for joint in [Joint::LeftKnee, Joint::RightAnkle, Joint::LeftWrist] {
        let share = found.rest_offset(joint).length() / skeleton.rest_offset(joint).length();
        assert!((share - 1.1).abs() < 0.03, "{}: {share}", joint.name());
    }
}
