//! Pictures against the f64 reference of the renderer's tests, and against the renderer.

use crate::device::device;
use crate::scenes::{attributes_of, view_of};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::Gaussian;
use renderer_splat::options::BackEnd;
use renderer_splat::picture::Image;
use splat_gradient::Picture;
use test_support::picture_check::{compare, draw, keep_pictures};
use test_support::splat_reference::{PixelBox, World, covered_box, psnr, render, to_image};
use test_support::splat_scenes::{
    front_camera, in_front_of_figure, random_gaussians, standing_figure,
};
use test_support::vulkan::gpu;

/// Least PSNR in dB on premultiplied colours and alpha, over what is covered.
const LEAST: f64 = 55.0;

fn image_of(picture: &Picture) -> Image {
    let [r, g, b, a] = [0, 1, 2, 3].map(|channel| picture.plane(channel));
    let pixels = (0..r.len())
        .map(|at| [r[at], g[at], b[at], a[at]])
        .collect();
    let side = |pixels: usize| u32::try_from(pixels).expect("few");
    Image::new(side(picture.width()), side(picture.height()), pixels).expect("as many")
}

fn drawn(gaussians: &[Gaussian], camera: &Camera) -> Option<Image> {
    let mut device = device()?;
    let attributes = attributes_of(gaussians);
    let drawn = device.draw(&attributes, &view_of(camera)).expect("drawn");
    Some(image_of(drawn.picture()))
}

/// Nothing where there is no device.
fn assert_like_reference(
    name: &str,
    gaussians: &[Gaussian],
    camera: &Camera,
) -> Option<(Image, PixelBox)> {
    let got = drawn(gaussians, camera)?;
    let expected = render(gaussians, camera);
    let within = covered_box(&expected).expect("something to see");
    let found = psnr(&got, &expected, within);
    println!("{name}: {found:.1} dB against the reference");
    if found.is_nan() || found < LEAST {
        let start = keep_pictures(
            &format!("gradient-{name}"),
            &got,
            &to_image(&expected).expect("its size"),
        );
        panic!("{name}: {found:.1} dB; see {start}-*.png");
    }
    Some((got, within))
}

/// The renderer's tiles, in the same place.
fn assert_like_renderer(
    name: &str,
    gaussians: &[Gaussian],
    camera: &Camera,
    got: &Image,
    within: PixelBox,
) {
    let Some(gpu) = gpu() else { return };
    let expected = draw(&gpu, BackEnd::Tiles, &World::of(gaussians), &[*camera]);
    let (found, most) = compare(got, &expected[0], within);
    println!("{name}: {found:.1} dB against the renderer, {most} at most");
    assert!(found >= LEAST, "{name}: {found:.1} dB against the renderer");
}

fn assert_drawn(name: &str, gaussians: &[Gaussian], camera: &Camera) {
    let Some((got, within)) = assert_like_reference(name, gaussians, camera) else {
        return;
    };
    assert_like_renderer(name, gaussians, camera, &got, within);
}

#[test]
fn a_person_looks_as_the_reference_and_the_renderer_draw_it() {
    let figure = standing_figure(40_000);
    assert_drawn("figure", &figure, &in_front_of_figure(512, 512));
}

#[test]
fn random_gaussians_look_as_the_reference_and_the_renderer_draw_them() {
    assert_drawn(
        "random",
        &random_gaussians(8_000, 7),
        &front_camera(300, 217),
    );
}

#[test]
fn a_view_from_among_the_gaussians_is_that_of_the_reference_and_the_renderer() {
    let camera = Camera::look_at(
        glam::Vec3::splat(0.05),
        glam::Vec3::X,
        glam::Vec3::Y,
        1.2,
        256,
        256,
    );
    assert_drawn("within", &random_gaussians(8_000, 5), &camera);
}

#[test]
fn equal_depths_are_blended_in_the_order_of_their_index() {
    let mut gaussians = random_gaussians(500, 13);
    for gaussian in &mut gaussians {
        gaussian.position = [0.1, 0.2, 0.0];
        gaussian.opacity *= 0.2;
    }
    assert_like_reference("stack", &gaussians, &front_camera(128, 128));
}

#[test]
fn limits_are_those_of_the_renderer() {
    let near = [
        splat_gradient::view::NEAR,
        renderer_splat::camera::DEFAULT_NEAR,
    ];
    assert_eq!(
        near[0].to_bits(),
        near[1].to_bits(),
        "near planes: {near:?}"
    );
    let most = u32::try_from(splat_gradient::view::MOST_PIXELS);
    assert_eq!(most, Ok(renderer_splat::limits::MOST_PIXELS), "pixels");
}
