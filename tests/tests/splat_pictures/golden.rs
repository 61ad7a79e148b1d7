//! Pictures against accepted ones: shows unintended changes, also where the reference would allow them.
//!
//! Under Mesa's lavapipe only, since every device rounds its own way. `MON3TR_UPDATE_GOLDEN=1` accepts what is drawn now.

use std::path::PathBuf;

use glam::Vec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, Filter};
use renderer_splat::picture::Image;
use renderer_vulkan::gpu::Gpu;
use test_support::picture_check::{BEHIND, draw, keep_pictures};
use test_support::splat_reference::World;
use test_support::splat_scenes::{eyes_at, in_front_of_figure, railing_and_wall, standing_figure};
use test_support::vulkan::{assert_silent, gpu};

const SIDE: u32 = 256;
/// Greatest difference of a channel, of 255: one step of rounding, and one where the CPU has no fused multiply-add.
const MOST: u8 = 2;
/// Mean difference, of 255: a few pixels in a hundred may round the other way.
const MOST_MEAN: f64 = 0.05;

fn golden(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("golden/{name}.png"))
}

fn accept(name: &str, rgb: &[u8]) {
    let path = golden(name);
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(rgb, SIDE, SIDE, ExtendedColorType::Rgb8)
        .expect("a PNG in memory");
    std::fs::write(&path, bytes).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    println!("accepted {}", path.display());
}

/// Opaque, from RGB bytes.
fn opaque(rgb: &[u8]) -> Image {
    let pixels = rgb.chunks_exact(3).map(|rgb| {
        let channel = |index: usize| f32::from(rgb[index]) / 255.0;
        [channel(0), channel(1), channel(2), 1.0]
    });
    Image::new(SIDE, SIDE, pixels.collect()).expect("as many pixels as that")
}

fn assert_golden(name: &str, drawn: &Image) {
    let got = drawn.over(BEHIND);
    let accept_how =
        "to accept it, look at the picture and run this test with MON3TR_UPDATE_GOLDEN=1";
    if std::env::var("MON3TR_UPDATE_GOLDEN").as_deref() == Ok("1") {
        accept(name, &got);
        return;
    }
    let path = golden(name);
    let expected = image::open(&path)
        .unwrap_or_else(|why| panic!("{}: {why}; {accept_how}", path.display()))
        .into_rgb8();
    assert_eq!(
        expected.dimensions(),
        (SIDE, SIDE),
        "size of {}",
        path.display()
    );
    let expected = expected.into_raw();
    let differences = || got.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b));
    let most = differences().max().unwrap_or(0);
    #[expect(clippy::cast_precision_loss, reason = "few pixels")]
    let mean = differences().map(f64::from).sum::<f64>() / got.len() as f64;
    println!("golden {name}: {most} of 255 at most, {mean:.4} in the mean");
    if most > MOST || mean > MOST_MEAN {
        let start = keep_pictures(&format!("golden-{name}"), &opaque(&got), &opaque(&expected));
        panic!(
            "{name} is not the accepted picture any more: channels differ by up to {most} of 255 (allowed {MOST}), by \
             {mean:.3} in the mean (allowed {MOST_MEAN}); see {start}-got.png, -expected.png and -difference.png (x16); \
             {accept_how}"
        );
    }
}

fn lavapipe_only(gpu: &Gpu) -> bool {
    let is_lavapipe = gpu.info().name.contains("llvmpipe");
    if !is_lavapipe {
        println!(
            "skipped: golden pictures are lavapipe's, not {}'s",
            gpu.info().name
        );
    }
    is_lavapipe
}

/// Draws the figure, behind the railing or not, and compares each view with its golden picture.
fn check(name: &str, back_end: BackEnd, with_scene: bool, filter: Filter, cameras: &[Camera]) {
    let Some(gpu) = gpu() else { return };
    if !lavapipe_only(&gpu) {
        return;
    }
    let (figure, scene) = (standing_figure(40_000), railing_and_wall());
    let world = World {
        foreground: &figure,
        background: with_scene.then_some(&scene),
        filter,
        ..World::default()
    };
    for (view, image) in draw(&gpu, back_end, &world, cameras).iter().enumerate() {
        let eye = match (cameras.len(), view) {
            (1, _) => "",
            (_, 0) => "-left",
            _ => "-right",
        };
        assert_golden(&format!("{name}{eye}"), image);
    }
    assert_silent(&gpu);
}

#[test]
fn a_person_looks_as_accepted() {
    let camera = [in_front_of_figure(SIDE, SIDE)];
    check("figure", BackEnd::Tiles, false, Filter::Dilation, &camera);
}

#[test]
fn a_person_looks_as_accepted_in_both_eyes() {
    let eyes = eyes_at(Vec3::new(0.35, 1.15, 2.4), SIDE, SIDE);
    check("stereo", BackEnd::Tiles, true, Filter::Dilation, &eyes);
}

#[test]
fn a_person_behind_a_railing_looks_as_accepted() {
    let camera = [in_front_of_figure(SIDE, SIDE)];
    for (name, back_end) in [
        ("railing-tiles", BackEnd::Tiles),
        ("railing-quads", BackEnd::Quads),
    ] {
        check(name, back_end, true, Filter::Dilation, &camera);
    }
}

#[test]
fn a_person_far_away_looks_as_accepted_with_the_mip_filter() {
    let (eye, target) = (Vec3::new(1.5, 1.6, 6.5), Vec3::new(0.0, 0.95, 0.0));
    let camera = [Camera::look_at(eye, target, Vec3::Y, 0.42, SIDE, SIDE)];
    check("mip", BackEnd::Tiles, true, Filter::Mip, &camera);
}
