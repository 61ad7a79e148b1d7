//! One body in several calibrated cameras, against the skeleton's own forward kinematics: poses, lengths, and what becomes of frames that few or no
//! cameras see.

#![allow(
    clippy::expect_used,
    clippy::cast_possible_truncation,
    reason = "tests fail by panicking; pixels and motion are f32"
)]

mod common;

use common::skeleton;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use motion_fit::body::landmark_places;
use motion_fit::body::several::{RoomMotion, RoomPose, Sight, fit, measure, view};
use motion_fit::body::terms::View;
use motion_fit::landmarks::blazepose::SHOULDERS;
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use spmm3::{Joint, MotionParams, Skeleton};
use std::ops::Range;

/// Seconds between frames.
const STEP: f64 = 1.0 / 30.0;
/// The way of the pelvis from frame to frame, metres.
const WAY: f32 = 0.02;

type Frame = Vec<Option<BodyLandmarks>>;

fn ring(cameras: usize) -> Vec<View> {
    (0..cameras)
        .map(|k| {
            let angle = std::f64::consts::TAU * k as f64 / cameras as f64;
            // y up becomes y down: half a turn about x, after the turn about the person.
            let turn =
                DMat3::from_rotation_x(std::f64::consts::PI + 0.15) * DMat3::from_rotation_y(angle);
            let eye = turn.transpose() * DVec3::new(0.0, 0.0, -3.5) + DVec3::Y;
            view(turn, -(turn * eye), 1100.0, DVec2::new(540.0, 700.0))
        })
        .collect()
}

/// Walks along x, `ahead` metres further than frames alone would bring them.
fn motion(frame: usize, ahead: f32) -> MotionParams {
    let swing = (frame as f32 * 0.1).sin();
    let mut motion = MotionParams::default();
    motion.root_translation = Vec3::new(WAY * frame as f32 + ahead, 0.03, -0.1);
    let turns = [
        (Joint::Pelvis, [0.05, 0.5, 0.0]),
        (Joint::LeftHip, [-0.3 * swing, 0.0, 0.05]),
        (Joint::RightHip, [0.3 * swing, 0.0, -0.05]),
        (Joint::LeftKnee, [0.4, 0.0, 0.0]),
        (Joint::LeftShoulder, [0.0, 0.3 * swing, -1.0]),
        (Joint::RightShoulder, [0.0, 0.0, 1.1]),
        (Joint::LeftElbow, [0.0, -0.7, 0.0]),
        (Joint::RightElbow, [0.0, 0.9 + 0.2 * swing, 0.0]),
    ];
    for (joint, turn) in turns {
        motion.set_axis_angle(joint, Vec3::from_array(turn));
    }
    motion
}

/// What the cameras see of the motion without any error.
fn seen(skeleton: &Skeleton, views: &[View], motion: &MotionParams) -> Frame {
    let places = landmark_places(skeleton, motion);
    (views.iter())
        .map(|view| {
            let mut points = [BodyPoint::default(); BODY_LANDMARKS];
            for (point, place) in points.iter_mut().zip(places) {
                if let Some(place) = place {
                    let place = place.as_dvec3().to_array();
                    let pixel = view.project(&place.into());
                    point.pixel = Vec2::new(pixel.x as f32, pixel.y as f32);
                    point.confidence = 1.0;
                }
            }
            Some(BodyLandmarks { points })
        })
        .collect()
}

/// A walk in which nobody is seen in some frames.
fn walk(views: &[View], frames: usize, unseen: &[Range<usize>]) -> Vec<Frame> {
    (0..frames)
        .map(|frame| {
            if unseen.iter().any(|gap| gap.contains(&frame)) {
                vec![None; views.len()]
            } else {
                seen(&skeleton(), views, &motion(frame, 0.0))
            }
        })
        .collect()
}

/// Distance of a frame's pelvis from where it is in truth, metres.
fn off(fitted: &RoomMotion, frame: usize) -> f32 {
    let rest = skeleton().rest_positions()[Joint::Pelvis.index()];
    let truth = rest + motion(frame, 0.0).root_translation;
    fitted.poses[frame].pelvis.distance(truth)
}

/// Asserts that each frame that was seen is where the person was, and says whether it was seen.
fn assert_followed(fitted: &RoomMotion, unseen: &[Range<usize>]) {
    for (frame, pose) in fitted.poses.iter().enumerate() {
        let gap = unseen.iter().any(|gap| gap.contains(&frame));
        let sight = if gap { Sight::Unseen } else { Sight::Agreed };
        assert_eq!(pose.sight, sight, "frame {frame}");
        let off = off(fitted, frame);
        assert!(gap || off < 2e-3, "{off} m in frame {frame}");
    }
}

#[test]
fn limbs_that_four_cameras_see_without_error_are_found_to_a_millimetre() {
    let (skeleton, views) = (skeleton(), ring(4));
    let fitted = fit(&skeleton, &views, &walk(&views, 6, &[]), STEP);
    use Joint::*;
    for (frame, pose) in fitted.poses.iter().enumerate() {
        let truth = motion(frame, 0.0);
        let mut found = MotionParams::default();
        pose.write(&mut found);
        let (true_joints, joints) = (skeleton.pose(&truth), fitted.skeleton.pose(&found));
        let root = pose.pelvis - fitted.skeleton.rest_positions()[0];
        // The shoulder joints are not here: no landmark tells the collar's turn about itself. Their landmarks are, below.
        for joint in [
            Pelvis, LeftHip, RightHip, LeftKnee, RightKnee, LeftAnkle, RightAnkle, LeftElbow,
            RightElbow, LeftWrist, RightWrist,
        ] {
            let off = joints.position(joint) + root
                - (true_joints.position(joint) + truth.root_translation);
            let name = joint.name();
            let millimetres = off.length() * 1e3;
            assert!(
                millimetres < 1.0,
                "{name} is {millimetres:.2} mm off in frame {frame}"
            );
        }
        found.root_translation = root;
        let places = landmark_places(&fitted.skeleton, &found);
        let true_places = landmark_places(&skeleton, &truth);
        for landmark in SHOULDERS {
            let off = places[landmark]
                .zip(true_places[landmark])
                .map(|(a, b)| a.distance(b));
            assert!(
                off.is_some_and(|off| off < 1e-3),
                "a shoulder is {off:?} m off in frame {frame}"
            );
        }
    }
}

/// How long a joint's bone is against the test skeleton's.
fn share(skeleton: &Skeleton, joint: Joint) -> f32 {
    skeleton.rest_offset(joint).length() / common::skeleton().rest_offset(joint).length()
}

#[test]
fn a_person_of_other_lengths_is_measured_by_frames_that_are_seen() {
    let views = ring(3);
    let person = skeleton().rest_positions().map(|p| p * 1.1);
    let person = Skeleton::new(person).expect("in range");
    // One frame in eight is seen: of every third frame too few would be.
    let frames: Vec<Frame> = (0..48)
        .map(|frame| match frame % 8 {
            3 => seen(&person, &views, &motion(frame, -0.4)),
            _ => vec![None; views.len()],
        })
        .collect();
    let measured = measure(&skeleton(), &views, &frames);
    let fitted = fit(&skeleton(), &views, &frames, STEP);
    assert_eq!(measured, fitted.skeleton, "the same of both");
    for joint in [Joint::LeftKnee, Joint::RightElbow, Joint::LeftAnkle] {
        let share = share(&measured, joint);
        assert!((share - 1.1).abs() < 0.02, "{}: {share}", joint.name());
    }
}

#[test]
fn bones_stay_in_their_range_however_often_they_are_measured() {
    let views = ring(4);
    for (size, limit) in [(2.0, 1.6), (0.4, 0.6)] {
        let person = skeleton().rest_positions().map(|p| p * size);
        let person = Skeleton::new(person).expect("in range");
        let frames: Vec<Frame> = (0..5)
            .map(|frame| seen(&person, &views, &motion(frame, 0.0)))
            .collect();
        let measured = measure(&skeleton(), &views, &frames);
        for joint in [Joint::LeftKnee, Joint::RightAnkle, Joint::Spine2] {
            let share = share(&measured, joint);
            assert!((share - limit).abs() < 1e-3, "{}: {share}", joint.name());
        }
    }
}

#[test]
fn a_gap_is_filled_between_its_neighbours_and_the_person_is_found_again_behind_it() {
    let views = ring(4);
    for gap in [5..6, 5..7, 4..24] {
        let gaps = [gap.clone()];
        let fitted = fit(&skeleton(), &views, &walk(&views, 28, &gaps), STEP);
        assert_followed(&fitted, &gaps);
        // The person walks evenly: what is between is on the way, too.
        for frame in gap.clone() {
            let off = off(&fitted, frame);
            assert!(off < 5e-3, "{off} m in frame {frame} of {gap:?}");
        }
        let knee = fitted.poses[gap.start].rotations[Joint::LeftKnee.index()];
        let angle = knee.to_axis_angle().1;
        assert!((angle - 0.4).abs() < 0.02, "a knee of {angle} radians");
    }
}

#[test]
fn a_person_who_is_elsewhere_after_a_gap_or_a_cut_is_found_there() {
    let views = ring(4);
    for gap in [0, 1, 2, 9] {
        let back = 6 + gap;
        let frames: Vec<Frame> = (0..back + 6)
            .map(|frame| {
                if (6..back).contains(&frame) {
                    return vec![None; views.len()];
                }
                let ahead = if frame < 6 { 0.0 } else { -1.2 };
                seen(&skeleton(), &views, &motion(frame, ahead))
            })
            .collect();
        let fitted = fit(&skeleton(), &views, &frames, STEP);
        let rest = skeleton().rest_positions()[Joint::Pelvis.index()];
        for (frame, pose) in fitted.poses.iter().enumerate() {
            let share = (frame as f32 - 5.0) / (gap as f32 + 1.0);
            let ahead = -1.2 * share.clamp(0.0, 1.0);
            let off = (pose.pelvis - rest).x - (WAY * frame as f32 + ahead);
            assert!(
                off.abs() < 5e-3,
                "{off} m in frame {frame} with a gap of {gap} frames"
            );
        }
    }
}

#[test]
fn a_person_who_has_turned_about_at_a_cut_is_turned_in_its_first_frame() {
    for cameras in [3, 4, 5] {
        let views = ring(cameras);
        let pelvis = |frame: usize| {
            let turn = if frame < 6 {
                0.5
            } else {
                0.5 + std::f32::consts::PI
            };
            Vec3::new(0.0, turn, 0.0)
        };
        let frames: Vec<Frame> = (0..12)
            .map(|frame| {
                let mut motion = motion(frame, 0.0);
                motion.set_axis_angle(Joint::Pelvis, pelvis(frame));
                seen(&skeleton(), &views, &motion)
            })
            .collect();
        let fitted = fit(&skeleton(), &views, &frames, STEP);
        for (frame, pose) in fitted.poses.iter().enumerate() {
            let truth = glam::Quat::from_scaled_axis(pelvis(frame));
            let off = pose.rotations[0].angle_between(truth).to_degrees();
            assert!(
                off < 5.0,
                "{off} degrees in frame {frame} of {cameras} cameras"
            );
            // Of two opposite pairs, either may have the arms: what came before and what is seen are as good as one another.
            let exchanged = pose.exchanged.contains(&true) && cameras != 4;
            assert!(!exchanged, "in frame {frame} of {cameras} cameras");
        }
    }
}

#[test]
fn the_pose_is_held_before_the_first_frame_that_is_seen_and_after_the_last() {
    let views = ring(4);
    let gaps = [0..7, 12..19];
    let fitted = fit(&skeleton(), &views, &walk(&views, 19, &gaps), STEP);
    assert_followed(&fitted, &gaps);
    for (held, of) in [(0..7, 7), (12..19, 11)] {
        for frame in held {
            let (pose, of) = (&fitted.poses[frame], &fitted.poses[of]);
            assert_eq!((pose.pelvis, pose.rotations), (of.pelvis, of.rotations));
        }
    }
}

#[test]
fn where_nobody_is_ever_seen_the_pose_is_finite_and_said_to_be_unseen() {
    let views = ring(4);
    let blank = Some(BodyLandmarks {
        points: [BodyPoint::default(); BODY_LANDMARKS],
    });
    for nothing in [None, blank] {
        let nobody = vec![vec![nothing; views.len()]; 3];
        let fitted = fit(&skeleton(), &views, &nobody, STEP);
        let waits = |pose: &RoomPose| pose.sight == Sight::Unseen && pose.pelvis.is_finite();
        assert!(fitted.poses.iter().all(waits), "nobody");
        for joint in Joint::ALL.into_iter().skip(1) {
            let share = share(&fitted.skeleton, joint);
            let name = joint.name();
            assert!(
                (share - 1.0).abs() < 1e-3 || share.is_nan(),
                "{name}: {share}"
            );
        }
    }
    assert!(fit(&skeleton(), &views, &[], STEP).poses.is_empty());
    assert_eq!(fit(&skeleton(), &[], &[vec![]], STEP).poses.len(), 1);
}

/// The landmarks as if the person stood elsewhere in the picture: another person, or a mistake.
fn moved(seen: &Option<BodyLandmarks>, by: Vec2) -> Option<BodyLandmarks> {
    let mut seen = seen.clone()?;
    for point in &mut seen.points {
        point.pixel += by;
    }
    Some(seen)
}

#[test]
fn what_one_camera_says_first_counts_only_near_to_where_two_agree() {
    let views = ring(4);
    let mut frames = walk(&views, 14, &[]);
    // At first a single camera sees somebody, and it is mistaken; then two see two different people.
    for frame in &mut frames[..3] {
        let wrong = moved(&frame[1], Vec2::new(260.0, 180.0));
        *frame = vec![None, wrong, None, None];
    }
    for frame in &mut frames[3..6] {
        let wrong = moved(&frame[2], Vec2::new(-60.0, 320.0));
        *frame = vec![None, frame[1].clone(), wrong, None];
    }
    let fitted = fit(&skeleton(), &views, &frames, STEP);
    for (frame, pose) in fitted.poses.iter().enumerate() {
        let sight = if frame < 6 {
            Sight::Doubtful
        } else {
            Sight::Agreed
        };
        assert_eq!(pose.sight, sight, "frame {frame}");
        let off = off(&fitted, frame);
        assert!(frame < 6 || off < 2e-3, "{off} m in frame {frame}");
    }
}

#[test]
fn a_person_whom_one_camera_sees_for_a_while_is_followed_by_it() {
    let views = ring(4);
    // Between frames of all cameras; alone, between gaps; and in stretches of its own before, between and after these.
    for gaps in [
        &[][..],
        &[4..8, 14..18],
        &[10..11, 11..12],
        &[4..8, 10..12, 14..18],
    ] {
        let mut frames = walk(&views, 22, gaps);
        for frame in &mut frames[8..14] {
            frame[0] = None;
            frame[2] = None;
            frame[3] = None;
        }
        let fitted = fit(&skeleton(), &views, &frames, STEP);
        let alone = (8..14).filter(|frame| !gaps.iter().any(|gap| gap.contains(frame)));
        for frame in alone {
            assert_eq!(fitted.poses[frame].sight, Sight::Doubtful);
            let off = off(&fitted, frame);
            assert!(off < 0.05, "{off} m in frame {frame}, gaps {gaps:?}");
        }
        assert!(off(&fitted, 21) < 2e-3, "behind it all is as before");
    }
}

#[test]
fn a_person_whom_only_one_camera_ever_sees_is_as_far_away_as_their_size_says() {
    let ring = ring(8);
    let rest = skeleton().rest_positions()[Joint::Pelvis.index()];
    // From before, from behind and from between.
    for camera in 0..8 {
        let views = &ring[camera..=camera];
        let fitted = fit(&skeleton(), views, &walk(views, 4, &[]), STEP);
        for (frame, pose) in fitted.poses.iter().enumerate() {
            assert_eq!(pose.sight, Sight::Doubtful);
            let truth = rest + motion(frame, 0.0).root_translation;
            let error = views[0].project(&truth.as_dvec3().to_array().into())
                - views[0].project(&pose.pelvis.as_dvec3().to_array().into());
            let (pixels, metres) = (error.norm(), pose.pelvis.distance(truth));
            assert!(
                pixels < 15.0 && metres < 0.5,
                "{pixels} pixels and {metres} m in camera {camera}"
            );
        }
    }
}

#[test]
fn frames_that_hold_more_or_fewer_bodies_than_there_are_views_are_read_as_far_as_they_go() {
    let views = ring(4);
    let whole = walk(&views, 5, &[]);
    let expected = fit(&skeleton(), &views[..3], &whole, STEP);
    let cut: Vec<Frame> = whole.iter().map(|frame| frame[..3].to_vec()).collect();
    assert_eq!(fit(&skeleton(), &views[..3], &cut, STEP), expected);
    // The fourth camera saw nothing.
    let fewer = fit(&skeleton(), &views, &cut, STEP);
    for (a, b) in fewer.poses.iter().zip(&expected.poses) {
        assert!(a.pelvis.distance(b.pelvis) < 1e-5, "{a:?} against {b:?}");
    }
    let uneven: Vec<Frame> = (whole.iter().enumerate())
        .map(|(k, frame)| frame[..k.min(4)].to_vec())
        .collect();
    let uneven = fit(&skeleton(), &views, &uneven, STEP);
    let of_each_view = |pose: &RoomPose| pose.reprojection_px.len() == views.len();
    assert!(uneven.poses.iter().all(of_each_view));
    let sights: Vec<Sight> = uneven.poses.iter().map(|pose| pose.sight).collect();
    use Sight::{Agreed, Doubtful, Unseen};
    assert_eq!(sights, [Unseen, Doubtful, Agreed, Agreed, Agreed]);
}
