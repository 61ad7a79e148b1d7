//! Where people are: opaque layers, most of them hidden.

use crate::attributes::{assert_all_alike, compare};
use crate::device::device;
use crate::scenes::{attributes_of, random_picture, view_of};
use splat_gradient::{Attributes, attributes::ATTRIBUTES};
use synthetic_person::Random;
use test_support::splat_scenes::{front_camera, random_gaussians};

#[test]
fn derivatives_of_opaque_layers_are_their_differences_but_for_what_is_hidden() {
    let Some(mut device) = device() else { return };
    let mut gaussians = random_gaussians(150, 21);
    for gaussian in &mut gaussians {
        gaussian.opacity = 0.9 + 0.0999 * gaussian.opacity;
        gaussian.scale = gaussian.scale.map(|scale| 0.05 + 2.0 * scale);
    }
    let compared = compare(
        &mut *device,
        &attributes_of(&gaussians),
        &view_of(&front_camera(40, 40)),
        0.0,
    );
    assert!(compared.share > 0.9, "{} of the pixels", compared.share);
    // Less than 1/255 of the light comes from what the splatter leaves out.
    assert_all_alike(&compared, 5e-3);
}

#[test]
fn alpha_that_is_held_at_its_most_has_no_derivatives() {
    let Some(mut device) = device() else { return };
    let mut gaussians = random_gaussians(4, 21);
    for (index, gaussian) in (0u8..).zip(&mut gaussians) {
        let x = if index % 2 == 0 { -0.6 } else { 0.6 };
        let y = if index < 2 { -0.6 } else { 0.6 };
        gaussian.position[..2].copy_from_slice(&[x, y]);
        gaussian.opacity = 0.9999;
        gaussian.scale = [0.6, 0.5, 0.4];
    }
    let attributes = attributes_of(&gaussians);
    let compared = compare(
        &mut *device,
        &attributes,
        &view_of(&front_camera(40, 40)),
        0.005,
    );
    assert!(compared.share > 0.2, "{} of the pixels", compared.share);
    assert_all_alike(&compared, 1e-4);
}

#[test]
fn what_nothing_shows_of_has_no_derivatives() {
    let Some(mut device) = device() else { return };
    // A wall of opaque splats before one that nobody sees.
    let mut gaussians = random_gaussians(41, 2);
    for gaussian in &mut gaussians {
        gaussian.position = gaussian.position.map(|x| 0.05 * x);
        gaussian.scale = [1.0; 3];
        gaussian.opacity = 0.98;
    }
    gaussians[40].position = [-0.4, -0.5, -3.0];
    let attributes = attributes_of(&gaussians);
    let alone = attributes_of(&gaussians[40..]);
    let view = view_of(&front_camera(40, 24));
    let alone = device.draw(&alone, &view).expect("drawn");
    let seen = alone.picture().plane(3).iter().any(|alpha| *alpha > 0.5);
    assert!(seen, "without the wall it is seen");
    drop(alone);
    let mut drawn = device.draw(&attributes, &view).expect("drawn");
    let mut gradients = Attributes::zeros(41);
    let by_pixel = random_picture(40, 24, &mut Random::new(5));
    drawn.backward(&by_pixel, &mut gradients).expect("one size");
    for plane in 0..ATTRIBUTES {
        let hidden = gradients.plane(plane)[40];
        assert!(hidden == 0.0, "plane {plane}: {hidden}");
    }
    assert!(
        gradients.numbers().iter().any(|x| *x != 0.0),
        "others have some"
    );
}
