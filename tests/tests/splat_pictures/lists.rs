//! The tiles' lists against every pixel of every splat.

use glam::{EulerRot, Quat};
use renderer_splat::gaussian::Gaussian;
use renderer_splat::lists::{CLOSE_LOOK, Splat, TILE_PIXELS, TileLists};
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use std::collections::HashSet;
use std::sync::Arc;
use synthetic_person::Random;
use test_support::picture_check::packed;
use test_support::splat_scenes::in_front_of_figure;
use test_support::vulkan::{assert_silent, gpu};

/// No multiple of a tile.
const WIDTH: u32 = 509;
const HEIGHT: u32 = 381;
/// Where a splat ends.
const ALPHA_CUT: f64 = 1.0 / 255.0;
/// A pixel this near the cut, as log2 of alpha, may fall on either side of it.
const ROUNDING: f64 = 1e-4;

/// From specks to needles across the picture, at all angles, some of them hardly there.
fn needles(count: usize) -> Vec<Gaussian> {
    let mut random = Random::new(22);
    let mut within = |low: f32, high: f32| low + (high - low) * random.unit();
    (0..count)
        .map(|_| {
            let [x, y, z] = [0; 3].map(|_| within(-3.2, 3.2));
            Gaussian {
                position: [within(-1.5, 1.5), within(-0.3, 2.2), within(-1.0, 1.0)],
                rotation: Quat::from_euler(EulerRot::XYZ, x, y, z).into(),
                scale: [-0.5, -2.0, -2.0].map(|most| within(-7.0, most).exp()),
                opacity: within(-5.0, 0.0).exp(),
                colour: [1.0; 3],
            }
        })
        .collect()
}

/// Greatest log2(alpha), less that of the cut, of a splat at the centre of a pixel of this tile.
fn peak(splat: &Splat, [column, row]: [u32; 2]) -> f64 {
    let [mean_x, mean_y, ux, uy, wy, opacity] = [
        splat.mean_x,
        splat.mean_y,
        splat.ux,
        splat.uy,
        splat.wy,
        splat.log2_opacity,
    ]
    .map(f64::from);
    let pixels = |tile: u32, end: u32| tile * TILE_PIXELS..((tile + 1) * TILE_PIXELS).min(end);
    let mut greatest = f64::NEG_INFINITY;
    for y in pixels(row, HEIGHT) {
        for x in pixels(column, WIDTH) {
            let (dx, dy) = (f64::from(x) + 0.5 - mean_x, f64::from(y) + 0.5 - mean_y);
            let falls = (ux * dx + uy * dy).powi(2) + (wy * dy).powi(2);
            greatest = greatest.max(opacity - falls);
        }
    }
    greatest - ALPHA_CUT.log2()
}

#[test]
fn each_list_has_every_splat_that_reaches_a_pixel_of_its_tile_and_few_others() {
    let Some(gpu) = gpu() else { return };
    let gaussians = packed(&needles(3_000));
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(3_000, WIDTH, HEIGHT, 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    renderer.set_foreground(&gaussians).expect("they fit");
    let left = in_front_of_figure(WIDTH, HEIGHT);
    let mut right = left;
    right.camera_from_world.translation.x -= 0.3;
    renderer.draw(&[left, right]).expect("a picture");
    let lists: TileLists = (renderer.read_back_lists())
        .expect("a device")
        .expect("tiles");
    let columns = WIDTH.div_ceil(TILE_PIXELS);
    // Of large splats: tiles of their rectangles, listed ones, those that have a pixel of theirs.
    let (mut around, mut listed, mut needed) = (0, 0, 0);
    for (number, view) in lists.views.iter().enumerate() {
        let mut touching = vec![HashSet::new(); gaussians.len()];
        for (tile, list) in (0..).zip(&view.lists) {
            for splat in list {
                let tile = [tile % columns, tile / columns];
                let is_new = touching[*splat as usize].insert(tile);
                assert!(is_new, "view {number}: {splat} twice in {tile:?}");
            }
        }
        for ((index, splat), (rect, touching)) in
            (view.splats.iter().enumerate()).zip(view.tiles.iter().zip(&touching))
        {
            let Some([first, top, last, bottom]) = *rect else {
                assert!(touching.is_empty(), "view {number}: {index} is not seen");
                continue;
            };
            let tiles: Vec<[u32; 2]> = (top..=bottom)
                .flat_map(|row| (first..=last).map(move |column| [column, row]))
                .collect();
            let inside = tiles.iter().filter(|tile| touching.contains(*tile)).count();
            assert_eq!(inside, touching.len(), "view {number}: {index} outside");
            let is_large = tiles.len() >= CLOSE_LOOK as usize;
            let mut reached = 0;
            for tile in &tiles {
                let peak = peak(splat, *tile);
                if peak > ROUNDING {
                    assert!(
                        touching.contains(tile),
                        "view {number}: {index} is missing in {tile:?}, {peak} above the cut: {splat:?}"
                    );
                    reached += 1;
                }
            }
            if is_large {
                around += tiles.len();
                listed += touching.len();
                needed += reached;
            }
        }
    }
    println!(
        "of {around} tiles around large splats {listed} are listed, {needed} have a pixel of theirs"
    );
    assert!(needed > 20_000 && needed * 10 < around * 8, "needles");
    // Some outlines pass between the centres of pixels.
    assert!(listed * 100 <= needed * 104, "{listed} for {needed}");
    assert_silent(&gpu);
}
