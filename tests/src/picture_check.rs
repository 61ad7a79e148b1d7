//! The renderer's pictures against the f64 reference.

use crate::splat_reference::{self, PixelBox, ReferencePicture};
use crate::vulkan::assert_silent;
use std::path::Path;
use std::sync::Arc;
use xr_renderer::{
    BackEnd, Backdrop, Camera, Gaussian, Gpu, Image, PackedGaussian, RenderError, RendererOptions,
    SplatRenderer,
};

/// A renderer of one back end, so that every picture of a test is drawn alike: the one that `MON3TR_BACK_END` names,
/// tiles without it.
pub fn renderer_for(
    gpu: &Arc<Gpu>,
    count: u32,
    width: u32,
    height: u32,
    views: u32,
) -> SplatRenderer {
    let quads = std::env::var("MON3TR_BACK_END").as_deref() == Ok("quads");
    let options = RendererOptions {
        back_end: Some(if quads {
            BackEnd::Quads
        } else {
            BackEnd::Tiles
        }),
        ..RendererOptions::new(count, width, height, views)
    };
    SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer")
}

/// Packs and draws.
///
/// # Errors
/// Those of the renderer.
pub fn show(
    renderer: &mut SplatRenderer,
    gaussians: &[Gaussian],
    cameras: &[Camera],
) -> Result<(), RenderError> {
    let packed: Vec<PackedGaussian> = gaussians.iter().map(PackedGaussian::from).collect();
    renderer.set_foreground(&packed)?;
    renderer.draw(cameras)
}

/// Draws `gaussians` once for each of `cameras`, which share one size.
pub fn draw(gpu: &Arc<Gpu>, gaussians: &[Gaussian], cameras: &[Camera]) -> Vec<Image> {
    let views = u32::try_from(cameras.len()).expect("few");
    let count = u32::try_from(gaussians.len()).expect("few");
    let (width, height) = (cameras[0].width, cameras[0].height);
    let mut renderer = renderer_for(gpu, count, width, height, views);
    show(&mut renderer, gaussians, cameras).expect("a picture");
    (0..views)
        .map(|view| renderer.read_back(view).expect("a view"))
        .collect()
}

/// Draws, compares with the reference over what the reference covers (PSNR of at least `least` dB), leaves the pictures
/// on failure, and demands that the validation layer stayed silent.
pub fn assert_drawn_as_reference(
    gpu: &Arc<Gpu>,
    name: &str,
    gaussians: &[Gaussian],
    cameras: &[Camera],
    least: f64,
) {
    for (view, (got, camera)) in draw(gpu, gaussians, cameras)
        .iter()
        .zip(cameras)
        .enumerate()
    {
        let expected = splat_reference::render(gaussians, camera);
        let within = splat_reference::covered_box(&expected).expect("something to see");
        let psnr = splat_reference::psnr(got, &expected, within);
        println!(
            "{name}, view {view}: {psnr:.1} dB over {}x{} pixels, subgroups of {}",
            within.right - within.left + 1,
            within.bottom - within.top + 1,
            gpu.subgroup_size()
        );
        if psnr.is_nan() || psnr < least || std::env::var_os("MON3TR_KEEP_PICTURES").is_some() {
            let folder = keep_pictures(&format!("{name}-{view}"), got, &expected, within);
            assert!(
                psnr >= least,
                "{name}, view {view}: {psnr:.1} dB, below {least}; see {folder}*.png"
            );
        }
    }
    assert_silent(gpu);
}

/// Leaves got, expected and difference (x16) as PNGs; returns the common start of their paths.
fn keep_pictures(name: &str, got: &Image, expected: &ReferencePicture, within: PixelBox) -> String {
    let start = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/pictures");
    std::fs::create_dir_all(&start).unwrap_or_else(|why| panic!("{}: {why}", start.display()));
    let start = start.join(format!("splat-{name}-"));
    let start = start.display().to_string();
    let expected = splat_reference::to_image(expected).expect("as large as it says");
    let difference = got
        .pixels()
        .iter()
        .zip(expected.pixels())
        .map(|(got, expected)| {
            let channel = |index: usize| 16.0 * (got[index] - expected[index]).abs();
            [channel(0), channel(1), channel(2), 1.0]
        });
    let difference =
        Image::new(got.width(), got.height(), difference.collect()).expect("same size");
    for (kind, image) in [
        ("got", got),
        ("expected", &expected),
        ("difference", &difference),
    ] {
        let bytes = image.over(Backdrop::Colour([0.1; 3]));
        let path = format!("{start}{kind}.png");
        image::save_buffer(
            &path,
            &bytes,
            image.width(),
            image.height(),
            image::ColorType::Rgb8,
        )
        .unwrap_or_else(|why| panic!("{path}: {why}"));
    }
    println!("kept {start}*.png (covered: {within:?})");
    start
}
