//! A person whose motion is known, seen by cameras whose poses are.

use capture::{Camera, FramePose};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use motion_fit::body::landmark_places;
use motion_fit::landmarks::{BODY_LANDMARKS, BodyLandmarks, BodyPoint};
use spmm3::{Joint, MotionParams, Skeleton};

/// BlazePose's landmarks of the hips.
const LEFT_HIP: usize = 23;
const RIGHT_HIP: usize = 24;

/// Four cameras around a person.
pub(crate) fn cameras() -> Vec<Camera> {
    (0..4)
        .map(|k| {
            let turn = DMat3::from_rotation_x(std::f64::consts::PI + 0.1)
                * DMat3::from_rotation_y(f64::from(k) * 1.5);
            let eye = turn.transpose() * DVec3::new(0.0, 0.0, -3.5) + DVec3::Y;
            Camera {
                name: format!("cam{k}"),
                size: [1080, 1400],
                focal: [1100.0, 1080.0],
                centre: [540.0, 700.0],
                distortion: [0.0; 5],
                camera_from_world: DAffine3 {
                    matrix3: turn,
                    translation: -(turn * eye),
                },
            }
        })
        .collect()
}

/// Arms swing, a knee bends, the person walks.
pub(crate) fn poses(skeleton: &Skeleton) -> Vec<FramePose> {
    (0..24)
        .map(|frame| {
            let swing = (frame as f32 * 0.35).sin();
            let mut motion = MotionParams::default();
            motion.root_translation = Vec3::new(0.03 * frame as f32 - 0.3, 0.0, 0.2 * swing);
            motion.set_axis_angle(Joint::LeftShoulder, Vec3::new(0.0, 0.5 * swing, -0.9));
            motion.set_axis_angle(Joint::RightShoulder, Vec3::new(0.0, 0.5 * swing, 0.9));
            motion.set_axis_angle(Joint::LeftKnee, Vec3::new(0.5 + 0.4 * swing, 0.0, 0.0));
            FramePose::of(&motion, skeleton)
        })
        .collect()
}

/// What a network without errors sees of a pose.
pub(crate) fn seen(camera: &Camera, skeleton: &Skeleton, pose: &FramePose) -> BodyLandmarks {
    let mut points = [BodyPoint::default(); BODY_LANDMARKS];
    let places = landmark_places(skeleton, &pose.on(skeleton));
    let hip = |landmark: usize| places[landmark].unwrap_or_default();
    let hips = (hip(LEFT_HIP) + hip(RIGHT_HIP)) * 0.5;
    for (point, place) in points.iter_mut().zip(places) {
        if let Some(place) = place {
            point.pixel = camera
                .project(place.as_dvec3())
                .expect("before it")
                .as_vec2();
            let turn = camera.camera_from_world.matrix3;
            point.metres = (turn * (place - hips).as_dvec3()).as_vec3();
            point.confidence = 0.9;
        }
    }
    BodyLandmarks { points }
}
