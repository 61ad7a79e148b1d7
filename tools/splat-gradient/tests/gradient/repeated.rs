//! The same bytes again, whatever was drawn before.

use crate::device::device;
use crate::scenes::{attributes_of, random_picture, view_of};
use splat_gradient::{Attributes, Picture, SplatDevice, view::Twist};
use synthetic_person::Random;
use test_support::splat_scenes::{in_front_of_figure, standing_figure};

/// The picture and every derivative that comes of it.
fn derived(
    device: &mut dyn SplatDevice,
    attributes: &Attributes,
    side: u32,
) -> (Picture, Attributes, Twist) {
    let view = view_of(&in_front_of_figure(side, side));
    let mut drawn = device.draw(attributes, &view).expect("drawn");
    let picture = drawn.picture().clone();
    let pixels = side as usize;
    let by_pixel = random_picture(pixels, pixels, &mut Random::new(6));
    let mut gradients = Attributes::zeros(attributes.len());
    let motion = drawn.backward(&by_pixel, &mut gradients);
    (picture, gradients, motion.expect("one size"))
}

#[test]
fn what_was_drawn_before_leaves_nothing_behind() {
    let Some(mut used) = device() else { return };
    let many = attributes_of(&standing_figure(3_000));
    // Most tiles that the figure fills are empty without all but its first Gaussian.
    let one = attributes_of(&standing_figure(3_000)[..1]);
    for (attributes, side) in [(&many, 120), (&one, 120), (&many, 64), (&one, 90)] {
        let Some(mut fresh) = device() else { return };
        let fresh = derived(&mut *fresh, attributes, side);
        assert!(
            derived(&mut *used, attributes, side) == fresh,
            "{} Gaussians, {side} pixels",
            attributes.len()
        );
    }
}
