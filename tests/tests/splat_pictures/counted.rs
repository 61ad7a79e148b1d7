//! The work of a picture, counted from its lists, against the picture itself.

use frame_budget::Work;
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use std::sync::Arc;
use test_support::picture_check::{compare, packed, whole};
use test_support::splat_scenes::standing_figure;
use test_support::vulkan::{assert_silent, gpu};

#[test]
fn the_counted_work_makes_the_picture_that_the_tiles_made() {
    let Some(gpu) = gpu() else { return };
    let figure = packed(&standing_figure(20_000));
    // No multiple of a tile: blocks at the edges are parts of one.
    let (width, height) = (333, 415);
    let camera = Camera::look_at(
        glam::Vec3::new(0.0, 1.0, 3.0),
        glam::Vec3::Y,
        glam::Vec3::Y,
        0.7,
        width,
        height,
    );
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(20_000, width, height, 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    renderer.set_foreground(&figure).expect("they fit");
    let mut right = camera;
    right.camera_from_world.translation.x -= 0.063;
    renderer.draw(&[camera, right]).expect("a picture");
    let lists = renderer
        .read_back_lists()
        .expect("a device")
        .expect("tiles");
    let work = Work::of(&lists);

    let pairs: u64 = work.views.iter().map(|view| view.pairs).sum();
    assert_eq!(pairs, u64::from(renderer.tile_pairs()), "pairs");
    assert_eq!(work.gaussians, 20_000);
    for (number, view) in (0..).zip(&work.views) {
        let drawn = renderer.read_back(number).expect("a view");
        let made = Image::new(width, height, view.pixels.clone()).expect("as many pixels");
        let (psnr, _) = compare(&drawn, &made, whole(&drawn));
        assert!(psnr > 60.0, "view {number}: {psnr:.1} dB");
        let covered = drawn.pixels().iter().filter(|pixel| pixel[3] > 0.0).count() as u64;
        assert!(
            view.covered.abs_diff(covered) * 1000 < covered,
            "{} pixels counted, {covered} drawn",
            view.covered
        );
        // A block blends each splat into 64 pixels, a hexagon has its own alone; each is in a tile.
        assert!(view.blends <= 64 * view.batches && view.blends * 64 > view.covered);
        assert!(view.fragments <= view.shaded && view.fragments > view.covered);
        assert!(view.pairs >= view.splats && view.splats <= work.sorted);
    }
    assert_silent(&gpu);
}

#[test]
fn quads_have_no_lists() {
    let Some(gpu) = gpu() else { return };
    if !BackEnd::Quads.runs_on(&gpu) {
        println!("skipped: this device draws no quads");
        return;
    }
    let options = RendererOptions {
        back_end: Some(BackEnd::Quads),
        ..RendererOptions::new(1, 16, 16, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    renderer.set_foreground(&[]).expect("none fits");
    let camera = Camera::look_at(
        glam::Vec3::new(0.0, 1.0, 3.0),
        glam::Vec3::Y,
        glam::Vec3::Y,
        0.7,
        16,
        16,
    );
    renderer.draw(&[camera]).expect("a picture");
    assert!(renderer.read_back_lists().expect("a device").is_none());
    assert_silent(&gpu);
}
