//! A device that its driver gives up, and going on with another: a test program of its own, since it spoils its device.

use mon3tr_tests::splat_scenes::{front_camera, random_gaussians, random_scene};
use mon3tr_tests::vulkan::{assert_silent, open_gpu, or_skip};
use std::sync::Arc;
use xr_renderer::{
    BackEnd, Background, PackedGaussian, RenderError, RendererOptions, SplatRenderer,
};

#[test]
fn a_renderer_goes_on_after_its_device_is_lost() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let camera = front_camera(128, 96);
    let options = RendererOptions {
        background: Some(Arc::new(Background::pack(&random_scene(500, 0, 7)))),
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(300, 128, 96, 1)
    };
    let foreground: Vec<PackedGaussian> = random_gaussians(300, 3)
        .iter()
        .map(PackedGaussian::from)
        .collect();
    let mut renderer = SplatRenderer::new(gpu.clone(), &options).expect("a renderer");
    renderer.set_foreground(&foreground).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture");
    let before = renderer.read_back(0).expect("a view");
    let drawn = |picture: &xr_renderer::Image| picture.pixels().iter().any(|pixel| pixel[3] > 0.5);
    assert!(drawn(&before), "something is in the picture");

    gpu.declare_lost();
    let lost = renderer.draw(&[camera]);
    assert!(matches!(lost, Err(RenderError::DeviceLost(_))), "{lost:?}");
    let again = renderer.recover().expect("another device");
    assert!(!Arc::ptr_eq(&again, &gpu), "not the lost one");
    renderer.set_foreground(&foreground).expect("a foreground");
    renderer.draw(&[camera]).expect("a picture again");
    let after = renderer.read_back(0).expect("a view");
    assert_eq!(before, after, "the background is there again too");
    assert_silent(&again);
}
