//! The motion that is found of landmarks whose pose is known, by one camera and by four.

mod common;

use capture::{Camera, FramePose};
use capture_completion::{Motion, fit_motion};
use common::{cameras, poses, seen};
use glam::Vec3;
use motion_fit::Subject;
use motion_fit::body::several::Sight;
use motion_fit::landmarks::Observation;
use spmm3::{Joint, Skeleton};
use synthetic_person::{Puppet, PuppetSize};

const RATE: f64 = 30.0;

/// Of each camera, what it sees of each pose.
fn observed(cameras: &[Camera], skeleton: &Skeleton, poses: &[FramePose]) -> Vec<Vec<Observation>> {
    let of = |camera: &Camera| {
        let numbered = (0u32..).zip(poses);
        let observations = numbered.map(|(frame, pose)| Observation {
            seconds: f64::from(frame) / RATE,
            body: Some(seen(camera, skeleton, pose).into()),
            ..Observation::default()
        });
        observations.collect()
    };
    cameras.iter().map(of).collect()
}

/// The body's joints in the world, metres.
fn joints(skeleton: &Skeleton, pose: &FramePose) -> Vec<Vec3> {
    let motion = pose.on(skeleton);
    let posed = skeleton.pose(&motion);
    let body = Joint::ALL.into_iter().take(Joint::Jaw.index());
    body.map(|joint| posed.position(joint) + motion.root_translation)
        .collect()
}

/// Mean distances of joints over the frames, millimetres: in the world, and once both pelvises are laid on each other.
fn off(skeleton: &Skeleton, truth: &[FramePose], found: &[FramePose]) -> [f32; 2] {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for (truth, found) in truth.iter().zip(found) {
        let (truth, found) = (joints(skeleton, truth), joints(skeleton, found));
        let shift = found[0] - truth[0];
        for (truth, found) in truth.iter().zip(found) {
            sums[0] += 1e3 * found.distance(*truth);
            sums[1] += 1e3 * (found - shift).distance(*truth);
            count += 1.0;
        }
    }
    sums.map(|sum: f32| sum / count)
}

fn fitted(count: usize) -> (Motion, [f32; 2]) {
    let avatar = Puppet::new(PuppetSize::SMALL).avatar();
    let skeleton = &avatar.skeleton;
    let (cameras, truth) = (cameras(), poses(skeleton));
    let cameras = &cameras[..count];
    let observations = observed(cameras, skeleton, &truth);
    let motion = fit_motion(&Subject::from(&avatar), cameras, &observations, RATE, true);
    assert_eq!(motion.poses.len(), truth.len(), "a pose for each frame");
    let off = off(skeleton, &truth, &motion.poses);
    println!(
        "{count} cameras: joints off by {:.1} mm, {:.1} mm from the pelvis",
        off[0], off[1]
    );
    (motion, off)
}

#[test]
fn four_cameras_find_the_pose_in_the_world() {
    let (motion, [world, body]) = fitted(4);
    assert!(world < 8.0 && body < 8.0, "{world} and {body} mm");
    assert!(motion.camera_from_world.is_none(), "their poses were known");
    assert_eq!(
        motion.frames_of(Sight::Unseen),
        0,
        "the person is seen in all"
    );
    for frame in &motion.reprojection_px {
        for error in frame {
            let error = error.expect("every camera sees the person");
            assert!(error < 12.0, "{error} px");
        }
    }
}

#[test]
fn one_camera_finds_the_pose_but_for_some_of_its_depth() {
    let (motion, [world, body]) = fitted(1);
    assert!(world < 130.0 && body < 80.0, "{world} and {body} mm");
    assert!(motion.camera_from_world.is_none(), "its pose was known");
    assert_eq!(
        motion.frames_of(Sight::Unseen),
        0,
        "the person is seen in all"
    );
}
