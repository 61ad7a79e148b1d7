//! Gaussians that cannot be drawn, and pictures that hardly are any.

use crate::device::device;
use crate::scenes::{attributes_of, random_picture, view_of};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use splat_gradient::{Attributes, SplatDevice, View};
use synthetic_person::Random;
use test_support::splat_scenes::{front_camera, random_gaussians};

/// Numbers and derivatives of a picture.
fn run(
    device: &mut dyn SplatDevice,
    attributes: &Attributes,
    view: &View,
) -> (Vec<f32>, Attributes) {
    let mut drawn = device.draw(attributes, view).expect("drawn");
    let numbers = drawn.picture().numbers().to_vec();
    let [width, height] = view.size();
    let by_pixel = random_picture(width, height, &mut Random::new(2));
    let mut gradients = Attributes::zeros(attributes.len());
    let motion = drawn.backward(&by_pixel, &mut gradients).expect("one size");
    assert!(motion.iter().all(|x| x.is_finite()), "{motion:?}");
    assert!(numbers.iter().all(|x| x.is_finite()), "pixels");
    assert!(
        gradients.numbers().iter().all(|x| x.is_finite()),
        "derivatives"
    );
    (numbers, gradients)
}

/// All `sound` Gaussians but with those of `broken` after them.
fn with(sound: &Attributes, broken: &[[f32; 14]]) -> Attributes {
    let mut all = Attributes::zeros(sound.len() + broken.len());
    for plane in 0..14 {
        let out = all.plane_mut(plane);
        out[..sound.len()].copy_from_slice(sound.plane(plane));
        for (out, broken) in out[sound.len()..].iter_mut().zip(broken) {
            *out = broken[plane];
        }
    }
    all
}

const PLAIN: [f32; 14] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -2.0, -2.0, -2.0, 1.0, 0.5, 0.5, 0.5,
];

#[test]
fn gaussians_that_cannot_be_drawn_change_nothing() {
    let Some(mut device) = device() else { return };
    let sound = attributes_of(&random_gaussians(100, 6));
    let view = view_of(&front_camera(50, 40));
    let mut broken = Vec::new();
    for plane in 0..14 {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            // An opacity of 1, one of 0 and a scale of 0 are sound.
            let sound =
                value.is_infinite() && (plane == 10 || value < 0.0 && (7..10).contains(&plane));
            if !sound {
                let mut one = PLAIN;
                one[plane] = value;
                broken.push(one);
            }
        }
    }
    let mut one = PLAIN;
    one[6] = 0.0;
    broken.push(one);
    // Before the near plane.
    one = PLAIN;
    one[..3].copy_from_slice(&[0.4, 0.5, 2.96]);
    broken.push(one);
    // Behind the camera, far away beside it, 400 m wide.
    for (plane, value) in [(2, 10.0), (0, 3e38), (1, -1e20), (7, 6.0)] {
        let mut one = PLAIN;
        one[plane] = value;
        broken.push(one);
    }
    let (expected, expected_gradients) = run(&mut *device, &sound, &view);
    let (got, gradients) = run(&mut *device, &with(&sound, &broken), &view);
    assert!(got == expected, "the picture changed");
    for plane in 0..14 {
        let (drawn, not_drawn) = gradients.plane(plane).split_at(sound.len());
        assert_eq!(drawn, expected_gradients.plane(plane), "plane {plane}");
        assert!(
            not_drawn.iter().all(|x| *x == 0.0),
            "plane {plane}: {not_drawn:?}"
        );
    }
}

#[test]
fn extremes_that_can_be_drawn_have_finite_derivatives() {
    let Some(mut device) = device() else { return };
    let view = view_of(&front_camera(50, 40));
    let mut extremes = Vec::new();
    for (plane, value) in [
        (7, f32::NEG_INFINITY),
        (8, -80.0),
        (9, 5.5),
        (10, f32::INFINITY),
        (10, f32::NEG_INFINITY),
        (10, 80.0),
        (11, 1e30),
        (11, -1e30),
        (6, 1e-11),
        (6, 1e18),
        (2, 2.9),
    ] {
        let mut one = PLAIN;
        one[plane] = value;
        extremes.push(one);
        one[7] = f32::NEG_INFINITY;
        one[8] = f32::NEG_INFINITY;
        one[9] = f32::NEG_INFINITY;
        extremes.push(one);
    }
    for one in extremes {
        let alone = with(&Attributes::zeros(0), &[one]);
        run(&mut *device, &alone, &view);
    }
}

#[test]
fn no_gaussians_and_pictures_of_one_pixel_are_drawn() {
    let Some(mut device) = device() else { return };
    let camera = front_camera(50, 40);
    let (numbers, _) = run(&mut *device, &Attributes::zeros(0), &view_of(&camera));
    assert!(numbers.iter().all(|x| *x == 0.0), "all transparent");
    let attributes = attributes_of(&random_gaussians(100, 6));
    for (width, height) in [(1, 1), (1, 33), (17, 1)] {
        let view = view_of(&front_camera(width, height));
        let (numbers, _) = run(&mut *device, &attributes, &view);
        assert_eq!(
            numbers.len(),
            4 * (width * height) as usize,
            "{width} x {height}"
        );
    }
}

#[test]
fn views_that_are_none_are_refused_with_the_reason() {
    let pose = Affine3A::IDENTITY;
    let scaled = Affine3A {
        matrix3: Mat3A::from_diagonal(Vec3::splat(2.0)),
        translation: Vec3A::ZERO,
    };
    let lost = Affine3A::from_translation(Vec3::new(f32::NAN, 0.0, 0.0));
    for (pose, focal, size, reason) in [
        (scaled, [9.0; 2], [8, 8], "rigid"),
        (lost, [9.0; 2], [8, 8], "finite"),
        (pose, [9.0, f32::INFINITY], [8, 8], "finite"),
        (pose, [9.0, 0.0], [8, 8], "focal"),
        (pose, [9.0; 2], [0, 8], "1 to 4096"),
        (pose, [9.0; 2], [8, 5000], "1 to 4096"),
    ] {
        let refused = View::new(pose, focal, [4.0; 2], size).map_err(|why| why.to_string());
        assert!(
            refused.as_ref().is_err_and(|why| why.contains(reason)),
            "{refused:?}"
        );
    }
}
