//! Captures of a puppet, whose truth is known.

use avatar_gradient::{Model, Networks, Posed};
use capture::{Camera, Capture, CaptureWriter, FramePose, HeldOut, Photograph};
use glam::{DAffine3, DMat3, DVec3};
use splat_gradient::{Picture, Splatter, View};
use spmm3::networks::{AttributeNetwork, MeshNetwork, QuantisedBases};
use spmm3::{Avatar, BoundGaussians, MotionParams, attribute};
use std::path::Path;
use synthetic_person::{Puppet, PuppetSize, Random};

/// Pixels along a picture's sides.
const SIDE: u32 = 96;

/// A puppet of 200 Gaussians that cover it.
pub(crate) fn puppet() -> Puppet {
    let mut puppet = Puppet::new(PuppetSize {
        gaussians: 200,
        ..PuppetSize::SMALL
    });
    let mut attributes = puppet.gaussians.attributes().to_vec();
    let count = puppet.gaussians.len();
    for plane in attribute::LOG_SCALE {
        attributes[plane * count..(plane + 1) * count].fill(0.045f32.ln());
    }
    attributes[attribute::OPACITY * count..(attribute::OPACITY + 1) * count].fill(4.0);
    puppet.gaussians = with_attributes(&puppet, attributes);
    puppet
}

fn with_attributes(puppet: &Puppet, attributes: Vec<f32>) -> BoundGaussians {
    let bound = &puppet.gaussians;
    BoundGaussians::new(
        &puppet.template,
        bound.triangles().to_vec(),
        bound.barycentrics().to_vec(),
        attributes,
    )
    .expect("a binding")
    .quantised()
}

/// The same person before anything was learnt: grey, its Gaussians out of place, its F_attr silent.
pub(crate) fn stranger(truth: &Puppet) -> Avatar {
    let mut puppet = truth.clone();
    let mut attributes = truth.gaussians.attributes().to_vec();
    let count = truth.gaussians.len();
    let mut random = Random::new(9);
    for plane in attribute::COLOUR {
        attributes[plane * count..(plane + 1) * count].fill(0.0);
    }
    for plane in attribute::OFFSET {
        for number in &mut attributes[plane * count..(plane + 1) * count] {
            *number += 0.01 * random.signed();
        }
    }
    attributes[attribute::OPACITY * count..(attribute::OPACITY + 1) * count].fill(1.0);
    puppet.gaussians = with_attributes(truth, attributes);
    let silent = vec![0.0; truth.attributes.bases.values().len()];
    let bases = truth.attributes.bases.bases();
    puppet.attributes.bases = QuantisedBases::quantise(bases, count, &silent).expect("zeros");
    puppet.avatar()
}

/// `count` cameras on a circle around the person.
fn cameras(count: u32) -> Vec<Camera> {
    (0..count)
        .map(|index| {
            let angle = f64::from(index) * std::f64::consts::TAU / f64::from(count) + 0.4;
            let eye = DVec3::new(3.2 * angle.sin(), 1.1, 3.2 * angle.cos());
            let forwards = (DVec3::new(0.0, 0.9, 0.0) - eye).normalize();
            let right = forwards.cross(DVec3::Y).normalize();
            let down = forwards.cross(right);
            let camera_from_world = DMat3::from_cols(right, down, forwards).transpose();
            Camera {
                name: format!("cam{index:02}"),
                size: [SIDE; 2],
                focal: [f64::from(SIDE) * 1.45; 2],
                centre: [f64::from(SIDE) / 2.0; 2],
                distortion: [0.0; 5],
                camera_from_world: DAffine3::from_mat3_translation(
                    camera_from_world,
                    camera_from_world * -eye,
                ),
            }
        })
        .collect()
}

/// Moderate poses.
pub(crate) fn motions(frames: u32) -> Vec<MotionParams> {
    let mut random = Random::new(21);
    (0..frames)
        .map(|_| {
            let mut motion = random.motion(0.15);
            motion.expression_mut().fill(0.0);
            motion.root_translation = 0.05 * random.vector();
            motion
        })
        .collect()
}

/// The camera as the splatter has it.
#[expect(clippy::cast_possible_truncation, reason = "single precision")]
fn view(camera: &Camera) -> View {
    let pose = camera.camera_from_world;
    let rigid = glam::Affine3A {
        matrix3: pose.matrix3.as_mat3().into(),
        translation: pose.translation.as_vec3().into(),
    };
    let focal = camera.focal.map(|focal| focal as f32);
    let centre = camera.centre.map(|centre| centre as f32);
    View::new(rigid, focal, centre, camera.size.map(|side| side as usize)).expect("a camera")
}

/// A package's networks, and the model that they move.
pub(crate) fn model(avatar: &Avatar) -> (Networks, Model) {
    let networks = Networks {
        gaussians: avatar.gaussians.clone(),
        mesh: MeshNetwork::read(&avatar.deform_graph, &avatar.template).expect("F_mesh"),
        attributes: AttributeNetwork::read(&avatar.deform_graph, &avatar.controllers)
            .expect("F_attr"),
    };
    let (skeleton, template) = (&avatar.skeleton, &avatar.template);
    let model = Model::new(skeleton, template, &avatar.controllers, &networks).expect("a model");
    (networks, model)
}

/// A photograph of what is drawn: colours are divided by alpha, as before a black wall.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within 0..=255"
)]
fn photograph(picture: &Picture) -> Photograph {
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
    let alpha = picture.plane(3);
    let rgb = (0..alpha.len()).flat_map(|at| {
        [0, 1, 2].map(|channel| byte(picture.plane(channel)[at] / alpha[at].max(1e-3)))
    });
    Photograph {
        size: [SIDE; 2],
        rgb: rgb.collect(),
        mask: Some(alpha.iter().map(|alpha| byte(*alpha)).collect()),
    }
}

/// Writes a capture of the puppet and opens it; `held_out` cameras and frames are kept away from training.
pub(crate) fn capture(
    folder: &Path,
    puppet: &Puppet,
    count: u32,
    motions: &[MotionParams],
    held_out: &HeldOut,
) -> Capture {
    let avatar = puppet.avatar();
    let (networks, model) = model(&avatar);
    let parameters = networks.parameters();
    let (mut posed, mut splatter) = (Posed::new(), Splatter::new());
    let cameras = cameras(count);
    let writer = CaptureWriter::create(folder, &cameras, motions.len(), 30.0).expect("a folder");
    for (frame, motion) in motions.iter().enumerate() {
        model
            .pose(&parameters, motion, None, &mut posed)
            .expect("posed");
        for (index, camera) in cameras.iter().enumerate() {
            let drawn = splatter.draw(posed.gaussians(), &view(camera));
            writer
                .write(index, frame, &photograph(drawn.picture()))
                .expect("written");
        }
    }
    let poses: Vec<FramePose> = (motions.iter())
        .map(|motion| FramePose::of(motion, &avatar.skeleton))
        .collect();
    writer.finish(Some(&poses), held_out).expect("finished");
    Capture::open(folder).expect("a capture")
}

/// How the person stands in each frame of a capture.
pub(crate) fn poses(capture: &Capture, avatar: &Avatar) -> Vec<MotionParams> {
    let poses = capture.poses().expect("motion").iter();
    poses.map(|pose| pose.on(&avatar.skeleton)).collect()
}
