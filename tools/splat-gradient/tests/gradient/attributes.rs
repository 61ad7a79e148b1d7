//! Derivatives by every attribute and by the camera's pose against central differences in f64.

use crate::device::device;
use crate::reference::{Eye, Frozen, numbers_of};
use crate::scenes::{attributes_of, random_picture, stretch_rotations, view_of};
use renderer_splat::camera::Camera;
use splat_gradient::attributes::{ATTRIBUTES, plane};
use splat_gradient::{Attributes, Picture, SplatDevice, View};
use std::ops::Range;
use synthetic_person::Random;
use test_support::splat_scenes::{front_camera, random_gaussians};

/// Steps of the differences: metres, quaternions' numbers, logarithms, logits, display values, radians.
const STEP: f64 = 1e-5;

/// What is differentiated: kinds of attributes with their planes.
pub(crate) const KINDS: [(&str, Range<usize>); 5] = [
    ("position", plane::POSITION),
    ("rotation", plane::ROTATION),
    ("log scale", plane::LOG_SCALE),
    ("opacity", plane::OPACITY..plane::OPACITY + 1),
    ("colour", plane::COLOUR),
];

/// Derivatives as the splatter gives them and as differences do.
pub(crate) struct Compared {
    pub(crate) got: Attributes,
    /// Of each Gaussian.
    pub(crate) expected: Vec<[f64; ATTRIBUTES]>,
    pub(crate) got_motion: [f64; 6],
    pub(crate) expected_motion: [f64; 6],
    /// Share of the pixels that took part.
    pub(crate) share: f64,
}

pub(crate) fn compare(
    device: &mut dyn SplatDevice,
    attributes: &Attributes,
    view: &View,
    least_through: f64,
) -> Compared {
    let gaussians = numbers_of(attributes);
    let eye = Eye::of(view);
    let frozen = Frozen::new(&gaussians, &eye, least_through);
    let [width, height] = eye.size;
    let mut by_pixel = random_picture(width, height, &mut Random::new(77));
    for channel in 0..4 {
        let plane = by_pixel.plane_mut(channel).iter_mut();
        for (number, clear) in plane.zip(&frozen.clear) {
            *number = if *clear { *number } else { 0.0 };
        }
    }
    let wide: Vec<f64> = by_pixel.numbers().iter().map(|x| f64::from(*x)).collect();

    let (got, got_motion) = backward(device, attributes, view, &by_pixel);
    let loss = |gaussians: &[[f64; 14]], eye: &Eye| frozen.loss(gaussians, eye, &wide);
    let mut changed = gaussians.clone();
    let expected = (0..gaussians.len()).map(|index| {
        std::array::from_fn(|k| {
            let side = |side: f64, changed: &mut Vec<[f64; 14]>| {
                changed[index][k] = gaussians[index][k] + side * STEP;
                let loss = loss(changed, &eye);
                changed[index][k] = gaussians[index][k];
                loss
            };
            (side(1.0, &mut changed) - side(-1.0, &mut changed)) / (2.0 * STEP)
        })
    });
    let expected = expected.collect();
    let expected_motion = std::array::from_fn(|k| {
        let side = |side: f64| {
            let mut motion = [0.0; 6];
            motion[k] = side * STEP;
            loss(&gaussians, &eye.moved(motion))
        };
        (side(1.0) - side(-1.0)) / (2.0 * STEP)
    });
    let clear: f64 = frozen
        .clear
        .iter()
        .map(|clear| f64::from(u8::from(*clear)))
        .sum();
    let all: f64 = frozen.clear.iter().map(|_| 1.0).sum();
    Compared {
        got,
        expected,
        got_motion,
        expected_motion,
        share: clear / all,
    }
}

fn backward(
    device: &mut dyn SplatDevice,
    attributes: &Attributes,
    view: &View,
    by_pixel: &Picture,
) -> (Attributes, [f64; 6]) {
    let mut drawn = device.draw(attributes, view).expect("drawn");
    let mut got = Attributes::zeros(attributes.len());
    let motion = drawn.backward(by_pixel, &mut got).expect("one size");
    (got, motion)
}

/// Demands that all derivatives of a kind are right: as a whole, and each by the greatest of its kind.
fn assert_alike(kind: &str, pairs: &[(f64, f64)], most: f64) {
    let square = |x: f64| x * x;
    let size: f64 = pairs.iter().map(|(_, expected)| square(*expected)).sum();
    let error: f64 = pairs
        .iter()
        .map(|(got, expected)| square(got - expected))
        .sum();
    let relative = (error / size).sqrt();
    let greatest = pairs
        .iter()
        .fold(0.0f64, |most, pair| most.max(pair.1.abs()));
    let worst = pairs.iter().fold(0.0f64, |most, (got, expected)| {
        most.max((got - expected).abs() / greatest)
    });
    println!(
        "{kind}: {relative:.1e} of the whole, {worst:.1e} at most, of {}",
        pairs.len()
    );
    assert!(size > 0.0, "{kind}: nothing to compare");
    assert!(
        relative <= most && worst <= most,
        "{kind}: {relative:e}, {worst:e}, not {most:e}"
    );
}

pub(crate) fn assert_all_alike(compared: &Compared, most: f64) {
    for (kind, planes) in KINDS {
        let pairs: Vec<(f64, f64)> = planes
            .flat_map(|plane| {
                let got = compared.got.plane(plane).iter();
                let expected = compared.expected.iter().map(move |all| all[plane]);
                got.map(|got| f64::from(*got)).zip(expected)
            })
            .collect();
        assert_alike(kind, &pairs, most);
    }
    let motion = compared
        .got_motion
        .into_iter()
        .zip(compared.expected_motion);
    let motion: Vec<(f64, f64)> = motion.collect();
    assert_alike("camera's shift", &motion[..3], most);
    assert_alike("camera's rotation", &motion[3..], most);
}

#[test]
fn derivatives_of_a_thin_cloud_are_its_differences() {
    let Some(mut device) = device() else { return };
    let mut gaussians = random_gaussians(60, 5);
    for gaussian in &mut gaussians {
        gaussian.opacity = 0.05 + 0.7 * gaussian.opacity;
        gaussian.scale = gaussian.scale.map(|scale| 2.0 * scale);
    }
    let mut attributes = attributes_of(&gaussians);
    stretch_rotations(&mut attributes, &mut Random::new(3));
    let compared = compare(
        &mut *device,
        &attributes,
        &view_of(&front_camera(53, 44)),
        0.01,
    );
    assert!(compared.share > 0.9, "{} of the pixels", compared.share);
    assert_all_alike(&compared, 1e-4);
}

#[test]
fn derivatives_at_the_jacobians_limits_are_its_differences() {
    let Some(mut device) = device() else { return };
    // Large Gaussians beyond the edges and near the camera.
    let mut gaussians = random_gaussians(40, 8);
    for (index, gaussian) in (0u8..).zip(&mut gaussians) {
        let [x, y, z] = gaussian.position;
        let side = if index % 2 == 0 { 1.7 } else { -1.7 };
        gaussian.position = match index % 4 {
            0 | 1 => [0.8 * side + 0.2 * x, y, 0.5 + z],
            _ => [x, 0.8 * side + 0.2 * y, 0.5 + z],
        };
        gaussian.scale = [0.5, 0.3, 0.1];
        gaussian.opacity = 0.1 + 0.3 * gaussian.opacity;
    }
    let camera = Camera {
        fx: 50.0,
        cx: 20.0,
        ..front_camera(48, 40)
    };
    let compared = compare(
        &mut *device,
        &attributes_of(&gaussians),
        &view_of(&camera),
        0.005,
    );
    assert!(compared.share > 0.5, "{} of the pixels", compared.share);
    assert_all_alike(&compared, 1e-4);
}

#[test]
fn derivatives_of_several_views_add_up() {
    let Some(mut device) = device() else { return };
    let attributes = attributes_of(&random_gaussians(30, 4));
    let view = view_of(&front_camera(32, 32));
    let by_pixel = random_picture(32, 32, &mut Random::new(1));
    let (once, motion) = backward(&mut *device, &attributes, &view, &by_pixel);
    let mut twice = Attributes::zeros(30);
    for _ in 0..2 {
        let mut drawn = device.draw(&attributes, &view).expect("drawn");
        let again = drawn.backward(&by_pixel, &mut twice).expect("one size");
        assert!(
            again == motion,
            "the camera's are not added: {again:?}, {motion:?}"
        );
    }
    let doubled: Vec<f32> = once.numbers().iter().map(|number| 2.0 * number).collect();
    assert_eq!(twice.numbers(), &doubled[..], "twice the same");
}

#[test]
fn a_moved_view_is_the_moved_reference() {
    let attributes = attributes_of(&random_gaussians(30, 4));
    let view = view_of(&front_camera(32, 32));
    let motion = [0.03, -0.02, 0.05, 0.04, -0.07, 0.02];
    let moved = view.moved(&motion);
    let (eye, expected) = (Eye::of(&moved), Eye::of(&view).moved(motion));
    let gaussians = numbers_of(&attributes);
    let ones = vec![1.0; 4 * 32 * 32];
    let losses =
        [eye, expected].map(|eye| Frozen::new(&gaussians, &eye, 0.0).loss(&gaussians, &eye, &ones));
    assert!((losses[0] / losses[1] - 1.0).abs() < 1e-5, "{losses:?}");
    assert_eq!(view.moved(&[f64::NAN; 6]), view, "no motion at all");
}

#[test]
fn sizes_that_do_not_fit_are_refused() {
    let Some(mut device) = device() else { return };
    let attributes = attributes_of(&random_gaussians(3, 4));
    let view = view_of(&front_camera(32, 32));
    let mut drawn = device.draw(&attributes, &view).expect("drawn");
    let small = Picture::transparent(31, 32);
    let mut gradients = Attributes::zeros(3);
    let refused = drawn
        .backward(&small, &mut gradients)
        .map_err(|why| why.to_string());
    assert!(
        refused.is_err_and(|why| why.contains("[31, 32]")),
        "a picture's size"
    );
    let refused = drawn.backward(&Picture::transparent(32, 32), &mut Attributes::zeros(4));
    assert!(refused.is_err(), "another number of Gaussians");
}
