//! The same as on the CPU, but for rounding.

use crate::attributes::KINDS;
use crate::device::device;
use crate::scenes::{attributes_of, random_picture, stretch_rotations, view_of};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use splat_gradient::view::Twist;
use splat_gradient::{Attributes, Picture, SplatDevice, Splatter};
use synthetic_person::Random;
use test_support::splat_scenes::{
    front_camera, in_front_of_figure, random_gaussians, standing_figure,
};
use test_support::vulkan::{gpu, rerun_with_other_subgroups};

/// The picture, and derivatives of a loss that looks at every pixel.
fn derived(
    device: &mut dyn SplatDevice,
    attributes: &Attributes,
    camera: &Camera,
) -> (Picture, Attributes, Twist) {
    let view = view_of(camera);
    let [width, height] = view.size();
    let mut drawn = device.draw(attributes, &view).expect("drawn");
    let picture = drawn.picture().clone();
    let by_pixel = random_picture(width, height, &mut Random::new(3));
    let mut gradients = Attributes::zeros(attributes.len());
    let motion = drawn.backward(&by_pixel, &mut gradients);
    (picture, gradients, motion.expect("one size"))
}

/// The root of the squares' sum of differences, by that of the expected numbers.
fn relative(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut error, mut size) = (0.0, 0.0);
    for (got, expected) in pairs {
        error += (got - expected).powi(2);
        size += expected.powi(2);
    }
    assert!(size > 0.0, "something to compare");
    (error / size).sqrt()
}

fn wide<'a>(got: &'a [f32], expected: &'a [f32]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let pairs = got.iter().zip(expected);
    pairs.map(|(got, expected)| (f64::from(*got), f64::from(*expected)))
}

/// Demands pictures that differ by less than a display shows, and derivatives that a training could not tell apart. Where alpha is just the cut,
/// or what shines through just ends a pixel, one of the two may leave out what the other draws.
fn assert_like_the_cpu(name: &str, gaussians: &[Gaussian], camera: &Camera) {
    let Some(mut device) = device() else { return };
    let mut attributes = attributes_of(gaussians);
    stretch_rotations(&mut attributes, &mut Random::new(3));
    let (expected, by_expected, motion_expected) =
        derived(&mut Splatter::new(), &attributes, camera);
    let (got, by_got, motion) = derived(&mut *device, &attributes, camera);
    let picture = relative(wide(got.numbers(), expected.numbers()));
    println!("{name}: picture {picture:.1e}");
    assert!(picture < 1e-4, "{name}: {picture:e} of the picture");
    for (kind, planes) in KINDS {
        let pairs = planes.flat_map(|plane| wide(by_got.plane(plane), by_expected.plane(plane)));
        let found = relative(pairs);
        println!("{name}: {kind} {found:.1e}");
        assert!(
            found < 1e-3,
            "{name}: {found:e} of the derivatives by {kind}"
        );
    }
    let pairs = motion.into_iter().zip(motion_expected);
    let found = relative(pairs);
    println!("{name}: camera {found:.1e}");
    assert!(
        found < 1e-3,
        "{name}: {found:e} of the camera's derivatives"
    );
}

#[test]
fn a_person_is_drawn_and_derived_as_on_the_cpu() {
    let figure = standing_figure(20_000);
    assert_like_the_cpu("figure", &figure, &in_front_of_figure(250, 331));
}

#[test]
fn gaussians_all_around_are_drawn_and_derived_as_on_the_cpu() {
    let camera = Camera::look_at(
        glam::Vec3::splat(0.05),
        glam::Vec3::X,
        glam::Vec3::Y,
        1.2,
        133,
        64,
    );
    assert_like_the_cpu("within", &random_gaussians(5_000, 5), &camera);
}

#[test]
fn layers_of_equal_depth_are_drawn_and_derived_as_on_the_cpu() {
    // So many that the sort's bins are crowded, and opaque in the end.
    let mut gaussians = random_gaussians(900, 13);
    for gaussian in &mut gaussians {
        gaussian.position = [0.1, 0.2, 0.0];
        gaussian.opacity *= 0.3;
    }
    assert_like_the_cpu("stack", &gaussians, &front_camera(70, 70));
}

#[test]
fn pictures_of_hardly_any_pixels_are_drawn_and_derived_as_on_the_cpu() {
    let gaussians = random_gaussians(100, 6);
    for (width, height) in [(1, 1), (1, 33), (17, 1)] {
        let name = format!("{width} x {height}");
        assert_like_the_cpu(&name, &gaussians, &front_camera(width, height));
    }
}

#[test]
fn other_subgroup_sizes_draw_and_derive_as_well() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["as_on_the_cpu"]) {
        assert!(text.contains("4 passed"), "subgroups of {size}: {text}");
    }
}
