//! Inputs at the edge: nothing, one, too much, broken numbers.

use std::sync::Arc;

use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use test_support::picture_check::{
    BACK_ENDS, assert_drawn_as_reference, depth_renderer_of, draw, renderer_for, show,
};
use test_support::splat_reference::World;
use test_support::splat_scenes::{eyes, front_camera, random_gaussians};
use test_support::vulkan::{assert_silent, gpu};

use crate::SPARSE;

#[test]
fn one_gaussian_is_drawn() {
    let Some(gpu) = gpu() else { return };
    let gaussians = [Gaussian {
        position: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.3, 0.1, 0.1],
        opacity: 1.0,
        colour: [1.0, 0.5, 0.2],
    }];
    let camera = [front_camera(256, 256)];
    assert_drawn_as_reference(&gpu, "one", &World::of(&gaussians), &camera, SPARSE);
}

#[test]
fn more_pairs_than_the_device_can_list_are_an_error_that_says_so() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(16_000, 19);
    for gaussian in &mut gaussians {
        gaussian.scale = [40.0; 3];
        gaussian.opacity = 1.0;
    }
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 16_000, 1024, 1024, 1);
    let away = Camera::look_at(Vec3::Z * 300.0, Vec3::Z * 600.0, Vec3::Y, 0.75, 1024, 1024);
    show(&mut renderer, &gaussians, &[away]).expect("a picture of nothing");
    match renderer.draw(&[front_camera(1024, 1024)]) {
        Err(RenderError::TooManyPairs { pairs, limit }) => {
            assert!(pairs > limit, "{pairs} pairs, {limit} fit");
        }
        // Refused before they are listed.
        Err(RenderError::CostlyPart { pairs, limit, .. }) => {
            assert!(pairs > u64::from(limit), "{pairs} pairs, {limit} fit");
        }
        // A device with larger buffers may draw them.
        other => assert!(!gpu.info().is_cpu && other.is_ok(), "{other:?}"),
    }
    // The order of the picture that failed must not be reused as that of the one before.
    renderer.draw(&[away]).expect("a picture of nothing");
    let image = renderer.read_back(0).expect("a view");
    let drawn = image.pixels().iter().filter(|pixel| pixel[3] > 0.0).count();
    assert_eq!(drawn, 0, "pixels of what is behind the camera");
    let few = random_gaussians(100, 1);
    show(&mut renderer, &few, &[front_camera(1024, 1024)]).expect("the renderer still draws");
    assert_silent(&gpu);
}

#[test]
fn nothing_to_draw_is_a_transparent_picture() {
    let Some(gpu) = gpu() else { return };
    let camera = front_camera(100, 100);
    let away = Camera::look_at(Vec3::Z * 3.0, Vec3::Z * 6.0, Vec3::Y, 0.75, 100, 100);
    let gaussians = random_gaussians(1_000, 23);
    for back_end in BACK_ENDS {
        let world = World::of(&gaussians);
        let mut renderer = depth_renderer_of(&gpu, back_end, &world, &[camera]);
        let transparent = |renderer: &mut SplatRenderer, why: &str| {
            let image = renderer.read_back(0).expect("a picture");
            let depths = renderer.read_back_depth(0).expect("a depth picture");
            let mut all = image.pixels().as_flattened().iter().chain(&depths);
            assert!(all.all(|value| *value == 0.0), "{back_end}: {why}");
        };
        transparent(&mut renderer, "before the first picture");
        show(&mut renderer, &gaussians, &[camera]).expect("a picture");
        show(&mut renderer, &[], &[camera]).expect("a picture of nothing");
        transparent(&mut renderer, "no Gaussians");
        show(&mut renderer, &gaussians, &[away]).expect("a picture of nothing");
        transparent(&mut renderer, "all behind the camera");
        let mut roomless = depth_renderer_of(&gpu, back_end, &World::of(&[]), &[camera]);
        show(&mut roomless, &[], &[camera]).expect("a picture of nothing");
        transparent(&mut roomless, "no room for Gaussians");
    }
    assert_silent(&gpu);
}

#[test]
fn gaussians_with_broken_numbers_are_left_out() {
    let Some(gpu) = gpu() else { return };
    let good = random_gaussians(3_000, 29);
    let mut mixed = Vec::new();
    for (index, gaussian) in good.iter().enumerate() {
        let mut broken = *gaussian;
        let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][index % 3];
        match index % 6 {
            0 => broken.position[index % 3] = value,
            1 => broken.opacity = value,
            2 => broken.rotation[index % 4] = value,
            3 => broken.scale[index % 3] = value,
            4 => broken.colour[index % 3] = value,
            _ => broken.scale = [3e38; 3],
        }
        mixed.extend([broken, *gaussian]);
    }
    let cameras = eyes(320, 320);
    for back_end in BACK_ENDS {
        let expected = draw(&gpu, back_end, &World::of(&good), &cameras);
        let got = draw(&gpu, back_end, &World::of(&mixed), &cameras);
        assert!(
            got == expected,
            "{back_end}: the broken ones change nothing"
        );
    }
    assert_silent(&gpu);
}

#[test]
fn the_same_input_gives_the_same_picture_to_the_last_bit() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(20_000, 31);
    for gaussian in &mut gaussians[..10_000] {
        gaussian.position[2] = 0.25;
    }
    let cameras = eyes(400, 400);
    for back_end in BACK_ENDS {
        let first = draw(&gpu, back_end, &World::of(&gaussians), &cameras);
        for _ in 0..3 {
            let again = draw(&gpu, back_end, &World::of(&gaussians), &cameras);
            assert!(again == first, "{back_end}: another picture");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn inputs_that_do_not_fit_the_renderer_are_refused_by_name() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 10, 64, 64, 1);
    let camera = front_camera(64, 64);
    let error = show(&mut renderer, &random_gaussians(11, 1), &[camera]).expect_err("11 of 10");
    assert!(error.to_string().contains("11 Gaussians"), "{error}");
    let error = show(&mut renderer, &[], &[camera, camera]).expect_err("2 cameras");
    assert!(
        error.to_string().contains("2 cameras for 1 view"),
        "{error}"
    );
    let error = show(&mut renderer, &[], &[front_camera(64, 65)]).expect_err("too high");
    assert!(error.to_string().contains("64x65"), "{error}");
    let mut scaled = camera;
    scaled.camera_from_world.matrix3 *= 1.5;
    let error = show(&mut renderer, &[], &[scaled]).expect_err("no rigid camera");
    assert!(error.to_string().contains("rigid"), "{error}");
    let error = renderer.read_back_depth(0).expect_err("no depth");
    assert!(matches!(error, RenderError::NoDepth), "{error}");
    let error = renderer.read_back(1).expect_err("1 view");
    assert!(error.to_string().contains("view 1"), "{error}");
    let error = SplatRenderer::new(Arc::clone(&gpu), &RendererOptions::new(10, 5000, 64, 1))
        .expect_err("too wide");
    assert!(error.to_string().contains("5000x64"), "{error}");
    let error = SplatRenderer::new(Arc::clone(&gpu), &RendererOptions::new(u32::MAX, 64, 64, 1))
        .expect_err("too many");
    assert!(error.to_string().contains("fewer Gaussians"), "{error}");
    assert_silent(&gpu);
}
