//! The renderer's Gaussians and cameras in this crate's types.

use glam::{Affine3A, Mat3A, Vec3A};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use splat_gradient::attributes::{Attributes, plane};
use splat_gradient::{Picture, View};
use synthetic_person::Random;

/// With their scales and opacities before activation.
pub(crate) fn attributes_of(gaussians: &[Gaussian]) -> Attributes {
    let mut attributes = Attributes::zeros(gaussians.len());
    for (index, gaussian) in gaussians.iter().enumerate() {
        let numbers = gaussian
            .position
            .into_iter()
            .chain(gaussian.rotation)
            .chain(gaussian.scale.map(f32::ln))
            .chain([(gaussian.opacity / (1.0 - gaussian.opacity)).ln()])
            .chain(gaussian.colour);
        for (plane, number) in numbers.enumerate() {
            attributes.plane_mut(plane)[index] = number;
        }
    }
    attributes
}

/// A camera that looks along -z, y up, as one that looks along z, y down.
pub(crate) fn view_of(camera: &Camera) -> View {
    let flip = Affine3A {
        matrix3: Mat3A::from_diagonal(glam::Vec3::new(1.0, -1.0, -1.0)),
        translation: Vec3A::ZERO,
    };
    View::new(
        flip * camera.camera_from_world,
        [camera.fx, camera.fy],
        [camera.cx, camera.cy],
        [camera.width as usize, camera.height as usize],
    )
    .expect("a camera that is right")
}

/// Random numbers in -1..1 for every pixel, as derivatives of some loss.
pub(crate) fn random_picture(width: usize, height: usize, random: &mut Random) -> Picture {
    let numbers = (0..4 * width * height).map(|_| random.signed()).collect();
    Picture::new(width, height, numbers).expect("as many as it takes")
}

/// Makes rotations' quaternions of all lengths, which changes no picture.
pub(crate) fn stretch_rotations(attributes: &mut Attributes, random: &mut Random) {
    for index in 0..attributes.len() {
        let length = 0.6 + random.unit();
        for plane in plane::ROTATION {
            attributes.plane_mut(plane)[index] *= length;
        }
    }
}
