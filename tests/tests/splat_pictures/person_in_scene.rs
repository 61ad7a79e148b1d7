//! Background and foreground in one order: a person behind a railing of splats, before a wall.

use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::picture::Image;
use test_support::picture_check::{assert_drawn_as_reference, compare, whole};
use test_support::splat_reference::World;
use test_support::splat_scenes::{
    BAR_COLOUR, between_bars, eyes_at, in_front_of_figure, on_a_bar, pixel_of, railing_and_wall,
    standing_figure,
};
use test_support::vulkan::gpu;

use crate::PACKED;

/// Tiles against quads, dB.
const LEAST_BETWEEN: f64 = 54.0;

/// How much a pixel looks like the bars: their yellow has little blue, and nothing else here has.
fn yellow(image: &Image, camera: &Camera, point: Vec3) -> f32 {
    let (x, y) = pixel_of(camera, point);
    let [red, _, blue, alpha] = image.pixels()[y * image.width() as usize + x];
    assert!(alpha > 0.95, "{alpha} of the scene at {x}, {y}");
    red - blue
}

fn assert_bars_in_front(pictures: &[Vec<Image>; 2], cameras: &[Camera]) {
    let bar = BAR_COLOUR[0] - BAR_COLOUR[2];
    for views in pictures {
        for (image, camera) in views.iter().zip(cameras) {
            let on = yellow(image, camera, on_a_bar());
            let beside = yellow(image, camera, between_bars());
            assert!(on > 0.8 * bar, "a bar, not the chest: {on} of {bar}");
            assert!(beside < 0.3 * bar, "the chest, not a bar: {beside}");
        }
    }
    let [tiles, quads] = pictures;
    for (tiles, quads) in tiles.iter().zip(quads) {
        let (psnr, most) = compare(tiles, quads, whole(tiles));
        println!("tiles against quads: {psnr:.1} dB, {most:.4} at most");
        assert!(psnr >= LEAST_BETWEEN, "tiles against quads: {psnr:.1} dB");
    }
}

#[test]
fn a_person_behind_a_railing_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(100_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let camera = [in_front_of_figure(1024, 1024)];
    let pictures = assert_drawn_as_reference(&gpu, "railing", &world, &camera, PACKED);
    assert_bars_in_front(&pictures, &camera);
}

#[test]
fn both_eyes_see_a_person_behind_a_railing_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(60_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let eyes = eyes_at(Vec3::new(0.35, 1.15, 2.4), 768, 768);
    let pictures = assert_drawn_as_reference(&gpu, "railing-stereo", &world, &eyes, PACKED);
    assert_bars_in_front(&pictures, &eyes);
}
