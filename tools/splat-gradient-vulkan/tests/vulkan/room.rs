//! What does not fit at first, what never does, and what draws nothing.

use crate::device::{Watched, device};
use crate::scenes::{attributes_of, random_picture, view_of};
use renderer_vulkan::gpu::Gpu;
use splat_gradient::error::GradientError;
use splat_gradient::{Attributes, Picture, SplatDevice, Splatter};
use std::sync::Arc;
use synthetic_person::Random;
use test_support::splat_scenes::{front_camera, random_gaussians};
use test_support::vulkan::{open_gpu, or_skip};

#[test]
fn more_pairs_than_there_was_room_for_are_drawn_and_derived() {
    let Some(mut device) = device() else { return };
    let camera = front_camera(500, 400);
    let view = view_of(&camera);
    for count in [1, 3, 40] {
        // As large as the picture: 800 tiles each.
        let mut gaussians = random_gaussians(count, 6);
        for gaussian in &mut gaussians {
            gaussian.scale = [2.0, 1.5, 1.0];
            gaussian.opacity = 0.1 + 0.2 * gaussian.opacity;
        }
        let attributes = attributes_of(&gaussians);
        let by_pixel = random_picture(500, 400, &mut Random::new(4));
        let run = |device: &mut dyn SplatDevice| -> (Picture, Attributes) {
            let mut drawn = device.draw(&attributes, &view).expect("drawn");
            let mut gradients = Attributes::zeros(count);
            drawn.backward(&by_pixel, &mut gradients).expect("one size");
            (drawn.picture().clone(), gradients)
        };
        let (picture, gradients) = run(&mut *device);
        let (expected, expected_gradients) = run(&mut Splatter::new());
        for (got, expected) in picture.numbers().iter().zip(expected.numbers()) {
            assert!((got - expected).abs() < 1e-4, "{count}: {got}, {expected}");
        }
        let size = |numbers: &[f32]| numbers.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        let most = size(expected_gradients.numbers());
        let pairs = gradients.numbers().iter().zip(expected_gradients.numbers());
        for (got, expected) in pairs {
            assert!(
                (got - expected).abs() < 1e-3 * most,
                "{count}: {got}, {expected}"
            );
        }
    }
}

#[test]
fn what_lies_behind_the_camera_is_not_drawn_and_has_no_derivatives() {
    let Some(mut device) = device() else { return };
    let view = view_of(&front_camera(40, 30));
    let mut gaussians = random_gaussians(70, 6);
    for gaussian in &mut gaussians {
        gaussian.position[2] += 9.0;
    }
    let attributes = attributes_of(&gaussians);
    let mut drawn = device.draw(&attributes, &view).expect("drawn");
    let nothing = drawn
        .picture()
        .numbers()
        .iter()
        .all(|number| *number == 0.0);
    assert!(nothing, "all transparent");
    let mut gradients = Attributes::zeros(70);
    let by_pixel = random_picture(40, 30, &mut Random::new(4));
    let motion = drawn.backward(&by_pixel, &mut gradients).expect("one size");
    assert_eq!(gradients, Attributes::zeros(70), "derivatives");
    assert!(motion.iter().all(|number| *number == 0.0), "{motion:?}");
}

#[test]
fn more_than_a_device_holds_is_refused_and_the_splatter_goes_on() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let mut device = Watched::new(&gpu);
    let view = view_of(&front_camera(2000, 2000));
    let count = 300_000;
    // Each as large as the picture: five billion pairs, more than 32 bits count.
    let mut one = attributes_of(&random_gaussians(1, 6));
    for plane in 7..10 {
        one.plane_mut(plane)[0] = 2.0;
    }
    let numbers = (0..14).flat_map(|plane| vec![one.plane(plane)[0]; count]);
    let many = Attributes::new(count, numbers.collect()).expect("as many");
    device.draw(&one, &view).expect("drawn");
    let before = gpu.memory_taken();
    let refused = device.draw(&many, &view).err().expect("too many");
    let GradientError::Device(why) = &refused else {
        panic!("{refused}");
    };
    assert!(why.to_string().contains("pairs"), "{why}");
    let after = gpu.memory_taken();
    assert!(
        after < before,
        "what there was is freed before there is more: {before} bytes, then {after}"
    );
    let small = view_of(&front_camera(40, 30));
    let drawn = device.draw(&one, &small).expect("drawn");
    assert!(drawn.picture().numbers().iter().any(|x| *x > 0.0), "drawn");
}

#[test]
fn copies_to_memory_of_the_devices_own_change_nothing() {
    let Some(mut gpu) = or_skip(open_gpu()) else {
        return;
    };
    let attributes = attributes_of(&random_gaussians(400, 6));
    let view = view_of(&front_camera(70, 50));
    let by_pixel = random_picture(70, 50, &mut Random::new(4));
    let run = |gpu: &Arc<Gpu>| {
        let mut splatter = Watched::new(gpu);
        let mut drawn = splatter.draw(&attributes, &view).expect("drawn");
        let mut gradients = Attributes::zeros(400);
        let motion = drawn.backward(&by_pixel, &mut gradients);
        (
            drawn.picture().clone(),
            gradients,
            motion.expect("one size"),
        )
    };
    let expected = run(&gpu);
    let only = Arc::get_mut(&mut gpu).expect("nothing else uses it");
    only.features_mut().shares_memory = false;
    assert!(run(&gpu) == expected, "through copies");
}

#[test]
fn a_lost_device_is_an_error_and_adds_nothing() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let mut splatter = Watched::new(&gpu);
    let attributes = attributes_of(&random_gaussians(20, 6));
    let view = view_of(&front_camera(40, 30));
    let mut drawn = splatter.draw(&attributes, &view).expect("drawn");
    gpu.declare_lost();
    let by_pixel = random_picture(40, 30, &mut Random::new(4));
    let mut gradients = Attributes::zeros(20);
    let said = drawn.backward(&by_pixel, &mut gradients);
    assert!(matches!(said, Err(GradientError::Device(_))), "{said:?}");
    assert_eq!(gradients, Attributes::zeros(20), "nothing was added");
    drop(drawn);
    assert!(splatter.draw(&attributes, &view).is_err(), "it stays lost");
}
