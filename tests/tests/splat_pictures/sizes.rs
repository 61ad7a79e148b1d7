//! Pictures smaller than the renderer was made for, as those of a renderer of their size.

use glam::Vec3;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::BackEnd;
use renderer_splat::picture::Backdrop;
use renderer_splat::window::{PresentOutcome, WindowTarget};
use renderer_vulkan::error::VulkanError;
use test_support::picture_check::{
    BACK_ENDS, depth_renderer_of, keep_pictures, renderer_for, renderer_of, show, views_of,
};
use test_support::splat_reference::World;
use test_support::splat_scenes::{
    eyes_at, front_camera, in_front_of_figure, railing_and_wall, random_gaussians, standing_figure,
};
use test_support::vulkan::{assert_silent, gpu};

/// Odd and even, of other proportions than the largest, down to one pixel, and the largest again.
const SIZES: [(u32, u32); 7] = [
    (240, 180),
    (121, 77),
    (239, 180),
    (16, 180),
    (160, 20),
    (1, 1),
    (240, 180),
];

/// The same view in another number of pixels.
fn at_size(camera: &Camera, width: u32, height: u32) -> Camera {
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    let (x, y) = (
        width as f32 / camera.width as f32,
        height as f32 / camera.height as f32,
    );
    Camera {
        fx: camera.fx * x,
        cx: camera.cx * x,
        fy: camera.fy * y,
        cy: camera.cy * y,
        width,
        height,
        ..*camera
    }
}

#[test]
fn a_smaller_picture_is_that_of_a_renderer_of_its_size() {
    let Some(gpu) = gpu() else { return };
    let (figure, scene) = (standing_figure(10_000), railing_and_wall());
    let world = World {
        background: Some(&scene),
        ..World::of(&figure)
    };
    let mono = vec![in_front_of_figure(240, 180)];
    let stereo = eyes_at(Vec3::new(0.35, 1.15, 2.4), 240, 180).to_vec();
    for cameras in [mono, stereo] {
        for back_end in BACK_ENDS {
            let mut large = depth_renderer_of(&gpu, back_end, &world, &cameras);
            for (width, height) in SIZES {
                let small_cameras: Vec<_> = cameras
                    .iter()
                    .map(|camera| at_size(camera, width, height))
                    .collect();
                let what = format!("{back_end}, {} view(s), {width}x{height}", cameras.len());
                large.draw(&small_cameras).expect("a picture");
                let mut small = depth_renderer_of(&gpu, back_end, &world, &small_cameras);
                small.draw(&small_cameras).expect("a picture");
                let (got, expected) = (views_of(&mut large), views_of(&mut small));
                for (view, (got, expected)) in (0..).zip(got.iter().zip(&expected)) {
                    assert_eq!((got.width(), got.height()), (width, height), "{what}: size");
                    if got != expected {
                        let start = keep_pictures("smaller", got, expected);
                        panic!("{what}, view {view}: another picture; see {start}-*.png");
                    }
                    let depths = large.read_back_depth(view).expect("depths");
                    assert_eq!(depths.len(), got.pixels().len(), "{what}: depths");
                    let same = depths == small.read_back_depth(view).expect("depths");
                    assert!(same, "{what}, view {view}: other depths");
                }
                assert_eq!(large.tile_pairs(), small.tile_pairs(), "{what}: pairs");
            }
        }
    }
    assert_silent(&gpu);
}

#[test]
fn a_smaller_picture_in_a_kept_order_is_whole() {
    let Some(gpu) = gpu() else { return };
    let figure = standing_figure(10_000);
    let start = in_front_of_figure(240, 180);
    for back_end in BACK_ENDS {
        let world = World::of(&figure);
        let mut large = renderer_of(&gpu, back_end, &world, &[start]);
        large.draw(&[start]).expect("a picture");
        let small = at_size(&start, 120, 90);
        large.draw(&[small]).expect("a picture");
        let first = views_of(&mut large);
        large.draw(&[start]).expect("a picture");
        large.draw(&[small]).expect("a picture");
        assert!(views_of(&mut large) == first, "{back_end}: another picture");
    }
    assert_silent(&gpu);
}

#[test]
fn cameras_too_large_or_of_different_sizes_are_refused() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 10, 64, 48, 2);
    for [left, right] in [
        [(65, 48), (65, 48)],
        [(64, 49), (64, 49)],
        [(0, 48), (0, 48)],
        [(64, 48), (32, 24)],
    ] {
        let cameras = [left, right].map(|(width, height)| Camera {
            width,
            height,
            ..front_camera(64, 48)
        });
        let refused = renderer.draw(&cameras);
        assert!(
            matches!(refused, Err(RenderError::Camera { .. })),
            "{left:?} and {right:?}: {refused:?}"
        );
    }
    renderer
        .draw(&[front_camera(32, 48); 2])
        .expect("a size that fits");
    assert_silent(&gpu);
}

#[test]
fn a_smaller_picture_is_shown_as_large_as_any_other() {
    let Some(gpu) = gpu() else { return };
    let mut window = match WindowTarget::headless(&gpu, 300, 200) {
        Ok(window) => window,
        Err(why @ VulkanError::NoPresentation { .. }) if !gpu.info().is_cpu => {
            println!("skipped: {why}");
            return;
        }
        Err(why) => panic!("{why}"),
    };
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 500, 96, 64, 1);
    for (width, height) in [(96, 64), (48, 32), (96, 64)] {
        let camera = front_camera(width, height);
        show(&mut renderer, &random_gaussians(500, 43), &[camera]).expect("a picture");
        let shown = window
            .present(&renderer, Backdrop::Colour([0.2; 3]))
            .expect("the window lives");
        assert_eq!(shown, PresentOutcome::Presented, "{width}x{height}");
    }
    drop(window);
    assert_silent(&gpu);
}
