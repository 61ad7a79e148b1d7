//! The Mip filter and the depth picture against the reference.

use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, Filter};
use test_support::picture_check::{
    BACK_ENDS, assert_drawn_as_reference, compare, depth_renderer_of, draw, views_of, whole,
};
use test_support::splat_reference::{World, depth_error, render_world};
use test_support::splat_scenes::{
    eyes_at, front_camera, railing_and_wall, random_gaussians, random_scene, standing_figure,
};
use test_support::vulkan::{assert_silent, gpu};

use crate::PACKED;

#[test]
fn the_mip_filter_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let (gaussians, scene) = (random_gaussians(10_000, 70), random_scene(10_000, 1, 73));
    let world = World {
        foreground: &gaussians,
        background: Some(&scene),
        filter: Filter::Mip,
        ..World::default()
    };
    assert_drawn_as_reference(&gpu, "mip", &world, &[front_camera(512, 512)], PACKED);
}

#[test]
fn the_mip_filter_keeps_a_person_far_away_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    // Splats of a tenth of a pixel: here the two filters differ most.
    let (figure, scene) = (standing_figure(60_000), railing_and_wall());
    let camera = Camera::look_at(
        Vec3::new(2.0, 2.0, 11.0),
        Vec3::new(0.0, 0.9, 0.0),
        Vec3::Y,
        0.3,
        400,
        400,
    );
    for (filter, name) in [(Filter::Mip, "far-mip"), (Filter::Dilation, "far")] {
        let world = World {
            foreground: &figure,
            background: Some(&scene),
            filter,
            ..World::default()
        };
        assert_drawn_as_reference(&gpu, name, &world, &[camera], PACKED);
    }
}

#[test]
fn depth_is_what_the_reference_says_in_both_eyes() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(60_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let eyes = eyes_at(Vec3::new(0.35, 1.15, 2.4), 512, 512);
    let expected = eyes.map(|eye| render_world(&world, &eye));
    for back_end in BACK_ENDS {
        // Halves hold 2 to 4 m in steps of 2 mm; quads round to one after each splat.
        let least_millimetres = match back_end {
            BackEnd::Tiles => 1.5,
            BackEnd::Quads => 6.0,
        };
        let mut renderer = depth_renderer_of(&gpu, back_end, &world, &eyes);
        renderer.draw(&eyes).expect("a picture");
        let images = views_of(&mut renderer);
        let alone = draw(&gpu, back_end, &world, &eyes);
        for (image, alone) in images.iter().zip(&alone) {
            let (_, most) = compare(image, alone, whole(image));
            assert!(most < 0.002, "{back_end}: colours change by {most}");
        }
        for (view, (image, expected)) in (0..).zip(images.iter().zip(&expected)) {
            let depths = renderer.read_back_depth(view).expect("a view");
            let (mean, most) = depth_error(image, &depths, expected).expect("something to see");
            println!(
                "depth, view {view}, {back_end}: {:.2} mm, {:.1} at most",
                1e3 * mean,
                1e3 * most
            );
            assert!(
                1e3 * mean <= least_millimetres,
                "view {view}, {back_end}: {:.2} mm",
                1e3 * mean
            );
        }
    }
    assert_silent(&gpu);
}
