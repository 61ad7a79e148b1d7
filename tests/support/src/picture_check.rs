//! The renderer's pictures against the f64 reference.

use crate::splat_reference::{self, PixelBox, ReferencePicture, World};
use crate::vulkan::assert_silent;
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::{Backdrop, Image};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Both, for tests that hold for either.
pub const BACK_ENDS: [BackEnd; 2] = [BackEnd::Tiles, BackEnd::Quads];

/// Least PSNR in dB against the reference.
#[derive(Debug, Clone, Copy)]
pub struct Least {
    /// Of the tiles, which blend in f32 and stop where less than 1/255 shows through.
    pub tiles: f64,
    /// Of the quads, which blend in half floats.
    pub quads: f64,
}

impl Least {
    /// The least PSNR of this back end.
    pub fn of(self, back_end: BackEnd) -> f64 {
        match back_end {
            BackEnd::Tiles => self.tiles,
            BackEnd::Quads => self.quads,
        }
    }
}

/// A renderer of a foreground alone.
pub fn renderer_for(
    gpu: &Arc<Gpu>,
    back_end: BackEnd,
    count: u32,
    width: u32,
    height: u32,
    views: u32,
) -> SplatRenderer {
    let options = RendererOptions {
        back_end: Some(back_end),
        ..RendererOptions::new(count, width, height, views)
    };
    SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer")
}

/// A renderer that holds a world, for pictures of these cameras' size.
pub fn renderer_of(
    gpu: &Arc<Gpu>,
    back_end: BackEnd,
    world: &World<'_>,
    cameras: &[Camera],
) -> SplatRenderer {
    renderer_with(gpu, back_end, world, cameras, false)
}

/// [`renderer_of`] that draws depth as well.
pub fn depth_renderer_of(
    gpu: &Arc<Gpu>,
    back_end: BackEnd,
    world: &World<'_>,
    cameras: &[Camera],
) -> SplatRenderer {
    renderer_with(gpu, back_end, world, cameras, true)
}

fn renderer_with(
    gpu: &Arc<Gpu>,
    back_end: BackEnd,
    world: &World<'_>,
    cameras: &[Camera],
    depth: bool,
) -> SplatRenderer {
    let count = |length: usize| u32::try_from(length).expect("few");
    let (width, height) = (cameras[0].width, cameras[0].height);
    let options = RendererOptions {
        back_end: Some(back_end),
        background: world
            .background
            .map(|scene| Arc::new(Background::pack(scene))),
        filter: world.filter,
        depth,
        ..RendererOptions::new(
            count(world.foreground.len()),
            width,
            height,
            count(cameras.len()),
        )
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    renderer
        .set_foreground(&packed(world.foreground))
        .expect("a foreground that fits");
    renderer
}

/// As they are uploaded.
pub fn packed(gaussians: &[Gaussian]) -> Vec<PackedGaussian> {
    gaussians.iter().map(PackedGaussian::from).collect()
}

/// Packs a foreground and draws.
///
/// # Errors
/// Those of the renderer.
pub fn show(
    renderer: &mut SplatRenderer,
    gaussians: &[Gaussian],
    cameras: &[Camera],
) -> Result<(), RenderError> {
    renderer.set_foreground(&packed(gaussians))?;
    renderer.draw(cameras)
}

/// The last picture of each view.
pub fn views_of(renderer: &mut SplatRenderer) -> Vec<Image> {
    (0..renderer.views())
        .map(|view| renderer.read_back(view).expect("a view"))
        .collect()
}

/// Draws a world once for each of `cameras`, which share one size.
pub fn draw(
    gpu: &Arc<Gpu>,
    back_end: BackEnd,
    world: &World<'_>,
    cameras: &[Camera],
) -> Vec<Image> {
    let mut renderer = renderer_of(gpu, back_end, world, cameras);
    renderer.draw(cameras).expect("a picture");
    views_of(&mut renderer)
}

/// Draws with both back ends, compares with the reference over what the reference covers, leaves the pictures on failure,
/// and demands that the validation layer stayed silent. Returns the tiles' pictures and the quads'.
pub fn assert_drawn_as_reference(
    gpu: &Arc<Gpu>,
    name: &str,
    world: &World<'_>,
    cameras: &[Camera],
    least: Least,
) -> [Vec<Image>; 2] {
    assert_drawn_by(gpu, BACK_ENDS, name, world, cameras, least)
}

/// [`assert_drawn_as_reference`] by other back ends than both.
pub fn assert_drawn_by<const N: usize>(
    gpu: &Arc<Gpu>,
    back_ends: [BackEnd; N],
    name: &str,
    world: &World<'_>,
    cameras: &[Camera],
    least: Least,
) -> [Vec<Image>; N] {
    let expected: Vec<ReferencePicture> = cameras
        .iter()
        .map(|camera| splat_reference::render_world(world, camera))
        .collect();
    let drawn = back_ends.map(|back_end| {
        let got = draw(gpu, back_end, world, cameras);
        for (view, (got, expected)) in got.iter().zip(&expected).enumerate() {
            let name = format!("{name}-{view}-{back_end}");
            assert_like_reference(gpu, &name, got, expected, least.of(back_end));
        }
        got
    });
    assert_silent(gpu);
    drawn
}

/// Compares a picture of each camera, drawn somehow, with the reference over what the reference covers, and leaves the
/// pictures on failure.
pub fn assert_pictures_like_reference(
    gpu: &Gpu,
    name: &str,
    world: &World<'_>,
    cameras: &[Camera],
    got: &[Image],
    least: f64,
) {
    assert_eq!(got.len(), cameras.len(), "{name}: views");
    for (view, (got, camera)) in got.iter().zip(cameras).enumerate() {
        let expected = splat_reference::render_world(world, camera);
        assert_like_reference(gpu, &format!("{name}-{view}"), got, &expected, least);
    }
}

fn assert_like_reference(
    gpu: &Gpu,
    name: &str,
    got: &Image,
    expected: &ReferencePicture,
    least: f64,
) {
    let within = splat_reference::covered_box(expected).expect("something to see");
    let psnr = splat_reference::psnr(got, expected, within);
    println!(
        "{name}: {psnr:.1} dB over {}x{} pixels, subgroups of {}",
        within.right - within.left + 1,
        within.bottom - within.top + 1,
        gpu.subgroup_size()
    );
    if psnr.is_nan() || psnr < least || std::env::var_os("MON3TR_KEEP_PICTURES").is_some() {
        let expected = splat_reference::to_image(expected).expect("as large as it says");
        let start = keep_pictures(&format!("splat-{name}"), got, &expected);
        assert!(
            psnr >= least,
            "{name}: {psnr:.1} dB, below {least}; see {start}-*.png"
        );
    }
}

/// PSNR in dB between two pictures of one size over a box (premultiplied RGBA, clamped to 0..=1), and the greatest
/// difference of a channel.
pub fn compare(a: &Image, b: &Image, within: PixelBox) -> (f64, f32) {
    assert_eq!(
        (a.width(), a.height()),
        (b.width(), b.height()),
        "sizes of the pictures"
    );
    let (mut squares, mut count, mut most) = (0.0, 0.0, 0.0f32);
    for y in within.top..=within.bottom {
        for x in within.left..=within.right {
            let index = y * a.width() as usize + x;
            for (a, b) in a.pixels()[index].iter().zip(b.pixels()[index]) {
                let difference = a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0);
                squares += f64::from(difference * difference);
                most = most.max(difference.abs());
                count += 1.0;
            }
        }
    }
    (-10.0 * (squares / count).log10(), most)
}

/// A whole picture's pixels.
pub fn whole(image: &Image) -> PixelBox {
    PixelBox {
        left: 0,
        top: 0,
        right: image.width() as usize - 1,
        bottom: image.height() as usize - 1,
    }
}

/// Leaves got, expected and difference (x16) as PNGs in `target/pictures`; returns the common start of their paths.
pub fn keep_pictures(name: &str, got: &Image, expected: &Image) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/pictures");
    std::fs::create_dir_all(&folder).unwrap_or_else(|why| panic!("{}: {why}", folder.display()));
    let folder = folder.canonicalize().unwrap_or(folder);
    let start = folder.join(name).display().to_string();
    let pixels = got.pixels().iter().zip(expected.pixels());
    let difference = pixels.map(|(got, expected)| {
        let channel = |index: usize| 16.0 * (got[index] - expected[index]).abs();
        [channel(0), channel(1), channel(2), 1.0]
    });
    let difference =
        Image::new(got.width(), got.height(), difference.collect()).expect("same size");
    for (kind, image) in [
        ("got", got),
        ("expected", expected),
        ("difference", &difference),
    ] {
        save_png(PathBuf::from(format!("{start}-{kind}.png")), image);
    }
    println!("kept {start}-*.png");
    start
}

/// The backdrop of a saved picture.
pub const BEHIND: Backdrop = Backdrop::Colour([0.1; 3]);

/// Writes a picture over [`BEHIND`].
pub fn save_png(path: impl AsRef<Path>, image: &Image) {
    let path = path.as_ref();
    let (bytes, kind) = (image.over(BEHIND), image::ColorType::Rgb8);
    image::save_buffer(path, &bytes, image.width(), image.height(), kind)
        .unwrap_or_else(|why| panic!("{}: {why}", path.display()));
}
