//! A made-up capture: a body of another shape than the average, in uneven clothes, in a few poses, in pictures of cameras around it. Posed, projected and
//! drawn by code that shares nothing with the crate but the body model and the T-pose.

use anyhow::{Context, Result};
use capture::{Camera, CaptureWriter, FramePose, HeldOut, Photograph};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use scan_rig::body::{BodyModel, posing};
use spmm3::{JOINTS, Joint, MotionParams};
use std::path::Path;

/// What the capture is like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scenario {
    /// Cameras around the person.
    pub(crate) cameras: usize,
    /// Frames; the first has the arms against the body.
    pub(crate) frames: usize,
    /// Pixels a side.
    pub(crate) side: u32,
    /// How far captured poses are off: metres of the pelvis, radians of a joint.
    pub(crate) noise: (f64, f64),
}

/// What is true of it.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Of each frame, world, metres.
    pub(crate) joints: Vec<[DVec3; JOINTS]>,
    /// The clothed surface of each frame, world, metres.
    pub(crate) vertices: Vec<Vec<DVec3>>,
}

/// Weights of the shapes of the person.
const SHAPE: [(&str, f64); 6] = [
    ("gender", -0.4),
    ("weight", 0.35),
    ("upperleg-scale-vert", 0.4),
    ("torso/torso-scale-horiz", -0.3),
    ("lowerarm-scale-vert", -0.3),
    ("measure/measure-hips", 0.3),
];

const SCALE: f64 = 1.03;

/// Clothes are so thick at least, and so much more at most, metres.
const CLOTH: (f64, f64) = (0.004, 0.022);

/// Writes the capture, some of it held out.
pub(crate) fn write(
    folder: &Path,
    model: &BodyModel,
    scenario: Scenario,
    held_out: &HeldOut,
) -> Result<Truth> {
    let mut random = fastrand::Rng::with_seed(17);
    let mut weights = vec![0.0; model.shapes.len()];
    for (name, weight) in SHAPE {
        let at = model.shapes.iter().position(|shape| shape.name == name);
        weights[at.context(name)?] = weight;
    }
    let (bare, rest_joints) = model.shaped(&weights);
    let rest = clothed(model, &bare);
    let straight = posing::t_pose(&rest_joints);
    let cameras: Vec<Camera> = (0..scenario.cameras)
        .map(|at| camera(at, scenario.cameras, scenario.side))
        .collect();
    let writer = CaptureWriter::create(folder, &cameras, scenario.frames, 30.0)?;
    let mut truth = Truth {
        joints: Vec::new(),
        vertices: Vec::new(),
    };
    let mut poses = Vec::new();
    for frame in 0..scenario.frames {
        let bends = bends(frame, &mut random);
        let pelvis = DVec3::new(0.05 * random.f64(), 0.95 + 0.02 * random.f64(), 0.04);
        let turns = world(&bends);
        let rotations: [DMat3; JOINTS] = std::array::from_fn(|j| turns[j] * straight[j]);
        let (vertices, joints) = posed(model, &rest, &rest_joints, &rotations, pelvis);
        for (at, camera) in cameras.iter().enumerate() {
            writer.write(at, frame, &picture(model, camera, &vertices))?;
        }
        poses.push(noisy(&bends, pelvis, scenario.noise, &mut random));
        truth.joints.push(joints);
        truth.vertices.push(vertices);
    }
    writer.finish(Some(&poses), held_out)?;
    Ok(truth)
}

fn clothed(model: &BodyModel, bare: &[DVec3]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; bare.len()];
    for face in &model.faces {
        let [a, b, c] = face.map(|v| bare[v as usize]);
        let normal = (b - a).cross(c - a);
        face.iter().for_each(|v| normals[*v as usize] += normal);
    }
    (bare.iter().zip(normals).enumerate())
        .map(|(v, (place, normal))| {
            let wave = (place.y * 9.0).sin() * (place.x * 7.0 + place.z * 5.0).cos();
            let thick = CLOTH.0 + CLOTH.1 * (0.5 + 0.5 * wave);
            *place + normal.normalize_or_zero() * thick * model.clothed_share(v)
        })
        .collect()
}

/// Joint rotations of a frame relative to the parents, axis times angle.
fn bends(frame: usize, random: &mut fastrand::Rng) -> [DVec3; JOINTS] {
    let mut bends = [DVec3::ZERO; JOINTS];
    let mut set = |joint: Joint, x: f64, y: f64, z: f64| {
        bends[joint.index()] = DVec3::new(x.to_radians(), y.to_radians(), z.to_radians());
    };
    let mut within = |low: f64, high: f64| low + (high - low) * random.f64();
    if frame == 0 {
        // Hands at the hips: the arms touch the body.
        set(Joint::LeftShoulder, 0.0, 0.0, -86.0);
        set(Joint::RightShoulder, 0.0, 0.0, 86.0);
        return bends;
    }
    set(Joint::Pelvis, 0.0, within(-120.0, 120.0), 0.0);
    set(
        Joint::Spine2,
        within(-5.0, 15.0),
        within(-15.0, 15.0),
        within(-8.0, 8.0),
    );
    set(Joint::Head, within(-10.0, 10.0), within(-25.0, 25.0), 0.0);
    set(
        Joint::LeftShoulder,
        0.0,
        within(-50.0, 10.0),
        within(-70.0, 30.0),
    );
    set(
        Joint::RightShoulder,
        0.0,
        within(-10.0, 50.0),
        within(-30.0, 70.0),
    );
    set(Joint::LeftElbow, 0.0, within(-90.0, -5.0), 0.0);
    set(Joint::RightElbow, 0.0, within(5.0, 90.0), 0.0);
    set(Joint::LeftHip, within(-60.0, 10.0), 0.0, within(0.0, 20.0));
    set(
        Joint::RightHip,
        within(-60.0, 10.0),
        0.0,
        within(-20.0, 0.0),
    );
    set(Joint::LeftKnee, within(0.0, 70.0), 0.0, 0.0);
    set(Joint::RightKnee, within(0.0, 70.0), 0.0, 0.0);
    bends
}

/// World rotations relative to T-pose.
fn world(bends: &[DVec3; JOINTS]) -> [DMat3; JOINTS] {
    let mut world = [DMat3::IDENTITY; JOINTS];
    for joint in Joint::ALL {
        let own = DMat3::from_quat(DQuat::from_scaled_axis(bends[joint.index()]));
        world[joint.index()] = match joint.parent() {
            Some(parent) => world[parent.index()] * own,
            None => own,
        };
    }
    world
}

/// Linear blend skinning of the rest pose, written out.
fn posed(
    model: &BodyModel,
    rest: &[DVec3],
    rest_joints: &[DVec3; JOINTS],
    rotations: &[DMat3; JOINTS],
    pelvis: DVec3,
) -> (Vec<DVec3>, [DVec3; JOINTS]) {
    let mut joints = [pelvis; JOINTS];
    for j in Joint::ALL {
        if let Some(p) = j.parent() {
            let bone = rest_joints[j.index()] - rest_joints[p.index()];
            joints[j.index()] = joints[p.index()] + rotations[p.index()] * bone * SCALE;
        }
    }
    let vertices = (0..rest.len())
        .map(|v| {
            let carried = (0..JOINTS).filter(|j| model.weights[v][*j] > 0.0).map(|j| {
                let arm = (rest[v] - rest_joints[j]) * SCALE;
                f64::from(model.weights[v][j]) * (rotations[j] * arm + joints[j])
            });
            carried.sum()
        })
        .collect();
    (vertices, joints)
}

fn camera(at: usize, of: usize, side: u32) -> Camera {
    let angle = std::f64::consts::TAU * at as f64 / of as f64;
    let height = [0.6, 1.4, 2.1][at % 3];
    let eye = DVec3::new(3.0 * angle.sin(), height, 3.0 * angle.cos());
    let away = (DVec3::new(0.0, 0.98, 0.0) - eye).normalize();
    let right = away.cross(DVec3::Y).normalize();
    let down = away.cross(right);
    let rotation = DMat3::from_cols(right, down, away).transpose();
    let size = f64::from(side);
    Camera {
        name: format!("c{at:02}"),
        size: [side, side],
        focal: [1.25 * size, 1.25 * size],
        centre: [0.5 * size, 0.5 * size + 1.0],
        distortion: [0.0; 5],
        camera_from_world: DAffine3 {
            matrix3: rotation,
            translation: -(rotation * eye),
        },
    }
}

/// The colour of the clothes at a vertex of the rest pose, display values.
pub(crate) fn colour(rest: DVec3) -> Vec3 {
    let wave = |axis: f64, speed: f64| 0.5 + 0.35 * (speed * axis).sin();
    DVec3::new(wave(rest.x, 9.0), wave(rest.y, 7.0), 0.35).as_vec3()
}

/// A picture before a bright wall, by a depth buffer.
#[expect(
    clippy::cast_possible_truncation,
    reason = "pixels within a picture, display values"
)]
fn picture(model: &BodyModel, camera: &Camera, vertices: &[DVec3]) -> Photograph {
    let [width, height] = camera.size.map(|side| side as usize);
    let mut depth = vec![f64::INFINITY; width * height];
    let mut rgb = vec![240_u8; 3 * width * height];
    let mut mask = vec![0_u8; width * height];
    let seen: Vec<(f64, f64, f64)> = (vertices.iter())
        .map(|vertex| {
            let p = camera.camera_from_world.transform_point3(*vertex);
            (
                camera.focal[0] * p.x / p.z + camera.centre[0],
                camera.focal[1] * p.y / p.z + camera.centre[1],
                p.z,
            )
        })
        .collect();
    for face in &model.faces {
        let [a, b, c] = face.map(|v| seen[v as usize]);
        let colours = face.map(|v| colour(model.rest[v as usize]));
        let bound = |values: [f64; 3], most: usize| {
            let low = values.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
            let high = values.into_iter().fold(0.0, f64::max).min(most as f64);
            (low.floor() as usize, high.ceil() as usize)
        };
        let (left, right) = bound([a.0, b.0, c.0], width);
        let (top, bottom) = bound([a.1, b.1, c.1], height);
        let edge = |p: (f64, f64, f64), q: (f64, f64, f64), x: f64, y: f64| {
            (q.0 - p.0) * (y - p.1) - (q.1 - p.1) * (x - p.0)
        };
        let area = edge(a, b, c.0, c.1);
        for y in top..bottom {
            for x in left..right {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let shares = [
                    edge(b, c, px, py) / area,
                    edge(c, a, px, py) / area,
                    edge(a, b, px, py) / area,
                ];
                if !shares.iter().all(|share| *share >= 0.0) {
                    continue;
                }
                let far = 1.0 / (shares[0] / a.2 + shares[1] / b.2 + shares[2] / c.2);
                let at = y * width + x;
                if far < depth[at] {
                    depth[at] = far;
                    mask[at] = 255;
                    let mixed: Vec3 = (colours.iter().zip(shares))
                        .map(|(colour, share)| *colour * share as f32)
                        .sum();
                    for (slot, value) in rgb[3 * at..3 * at + 3].iter_mut().zip(mixed.to_array()) {
                        *slot = (value * 255.0).round() as u8;
                    }
                }
            }
        }
    }
    Photograph {
        size: camera.size,
        rgb,
        mask: Some(mask),
    }
}

/// The pose as it was captured.
fn noisy(
    bends: &[DVec3; JOINTS],
    pelvis: DVec3,
    noise: (f64, f64),
    random: &mut fastrand::Rng,
) -> FramePose {
    let mut off = |size: f64| {
        let mut one = || (0..6).map(|_| random.f64()).sum::<f64>() - 3.0;
        DVec3::new(one(), one(), one()) * size * 2.0_f64.sqrt()
    };
    let mut parameters = MotionParams::default();
    for joint in Joint::ALL {
        let shaken = if joint.index() < Joint::Jaw.index() {
            DQuat::from_scaled_axis(off(noise.1) / 3.0_f64.sqrt())
        } else {
            DQuat::IDENTITY
        };
        let turn = shaken * DQuat::from_scaled_axis(bends[joint.index()]);
        parameters.set_rotation(joint, turn.as_quat());
    }
    FramePose {
        parameters,
        pelvis: (pelvis + off(noise.0) / 3.0_f64.sqrt()).as_vec3(),
    }
}
