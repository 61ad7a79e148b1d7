//! The avatar drawn in motions that are known, from cameras that are known: pictures with perfect truth.

use super::score::{FINGERS, LIMBS, Posed, WholeBody};
use glam::{Affine3A, DQuat, DVec3, Quat, Vec3};
use mon3tr::viewpoint::Viewpoint;
use motion_fit::landmarks;
use renderer_splat::camera::Camera;
use spmm3::{Avatar, Joint, MotionClip, MotionParams, Playback};

/// Size of a picture.
pub(super) const WIDTH: u32 = 720;
pub(super) const HEIGHT: u32 = 960;
/// Pictures a second.
pub(super) const RATE: f64 = 30.0;

/// A person's distance and height of a camera, by name: before them, to their side and above, and as on a desk. Eye, target, and the
/// vertical field of view in degrees.
const CAMERAS: [(&str, &str); 3] = [
    ("front", "0,1.2,3.4:0,0.95,0:38"),
    ("oblique", "2.3,1.7,2.7:0,0.95,0:38"),
    ("desk", "0,1.25,1.5:0,1.3,0:44"),
];

/// One motion seen by one camera.
#[derive(Debug)]
pub(super) struct Take {
    /// The motion's name and the camera's.
    pub(super) motion: String,
    pub(super) camera_name: &'static str,
    pub(super) camera: Camera,
    pub(super) frames: Vec<MotionParams>,
}

/// Every motion from every camera, `seconds` of each at most.
pub(super) fn takes(
    avatar: &Avatar,
    clips: &[MotionClip],
    seconds: f64,
) -> anyhow::Result<Vec<Take>> {
    let mut takes = Vec::new();
    for clip in clips {
        let frames: Vec<MotionParams> = sampled(clip, seconds);
        for (camera_name, place) in CAMERAS {
            let viewpoint: Viewpoint = place.parse()?;
            let floor = middle(avatar, &frames);
            takes.push(Take {
                motion: clip.name.clone(),
                camera_name,
                camera: viewpoint.camera(floor, heading(&frames), WIDTH, HEIGHT),
                frames: frames.clone(),
            });
        }
    }
    Ok(takes)
}

fn sampled(clip: &MotionClip, seconds: f64) -> Vec<MotionParams> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some seconds of frames"
    )]
    let count = (clip.duration().min(seconds) * RATE).floor().max(1.0) as u32;
    (0..count)
        .map(|k| clip.sample(f64::from(k) / RATE, Playback::Clamp))
        .collect()
}

/// Mean of where the person stands, on the floor.
fn middle(avatar: &Avatar, frames: &[MotionParams]) -> Vec3 {
    let pelvis = avatar.skeleton.rest_positions()[Joint::Pelvis.index()];
    let sum: Vec3 = frames.iter().map(|m| m.root_translation + pelvis).sum();
    let mean = sum / frames.len().max(1) as f32;
    Vec3::new(mean.x, 0.0, mean.z)
}

/// Which way the person faces on average, as a turn about y from +z.
fn heading(frames: &[MotionParams]) -> Quat {
    let forward: Vec3 = (frames.iter())
        .map(|m| m.rotation(Joint::Pelvis) * Vec3::Z)
        .sum();
    Quat::from_rotation_y(forward.x.atan2(forward.z))
}

/// The camera as the fit knows it.
pub(super) fn pinhole(camera: &Camera) -> landmarks::Camera {
    landmarks::Camera {
        size: glam::Vec2::new(camera.width as f32, camera.height as f32),
        focal: camera.fx,
        centre: glam::Vec2::new(camera.cx, camera.cy),
    }
}

/// From the room to the axes of the fit's camera: x right, y down, z away.
pub(super) fn sight_from_room(camera: &Camera) -> Affine3A {
    Affine3A::from_scale(Vec3::new(1.0, -1.0, -1.0)) * camera.camera_from_world
}

/// A person of `motion` in a room that `sight_from_room` leads to the camera's axes from.
pub(super) fn posed(
    avatar: &Avatar,
    motion: &MotionParams,
    sight_from_room: Affine3A,
    camera: &landmarks::Camera,
) -> Posed {
    let joints = avatar.skeleton.pose(motion);
    let place = |joint: Joint| joints.position(joint) + motion.root_translation;
    let seen = |joint: Joint| sight_from_room.transform_point3(place(joint)).as_dvec3();
    let project = |p: DVec3| {
        let z = p.z.max(1e-3);
        let along = |p: f64, centre: f32| f64::from(camera.focal) * p / z + f64::from(centre);
        [along(p.x, camera.centre.x), along(p.y, camera.centre.y)]
    };
    let pixels = LIMBS.map(|joint| project(seen(joint)));
    let inside = |[x, y]: [f64; 2]| {
        (0.0..f64::from(camera.size.x)).contains(&x) && (0.0..f64::from(camera.size.y)).contains(&y)
    };
    let turn = Quat::from_mat3a(&sight_from_room.matrix3);
    let mut fingers = [DQuat::IDENTITY; FINGERS];
    for (to, joint) in fingers
        .iter_mut()
        .zip(Joint::ALL.into_iter().skip(Joint::LeftIndex1.index()))
    {
        *to = motion.rotation(joint).as_dquat();
    }
    let mut expression = [0.0; spmm3::EXPRESSION];
    for (to, from) in expression.iter_mut().zip(motion.expression()) {
        *to = f64::from(*from);
    }
    Posed {
        limbs: LIMBS.map(seen),
        pixels,
        known: [true; LIMBS.len()],
        seen: pixels.map(inside),
        whole_body: Some(WholeBody {
            feet: [Joint::LeftFoot, Joint::RightFoot].map(|joint| place(joint).as_dvec3()),
            pelvis: (turn * motion.rotation(Joint::Pelvis)).as_dquat(),
            fingers,
            jaw: f64::from(motion.axis_angle(Joint::Jaw).x),
            expression,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cameras_axes_are_those_of_the_pictures() {
        let viewpoint: Viewpoint = CAMERAS[0].1.parse().expect("a viewpoint");
        let camera = viewpoint.camera(Vec3::ZERO, Quat::IDENTITY, WIDTH, HEIGHT);
        let sight = sight_from_room(&camera);
        let at = sight.transform_point3(Vec3::new(0.3, 0.95, 0.0));
        assert!(at.x > 0.29 && at.z > 3.3 && at.y.abs() < 0.01, "{at}");
        let higher = sight.transform_point3(Vec3::new(0.0, 1.5, 0.0));
        assert!(higher.y < -0.5, "y is down: {higher}");
    }
}
