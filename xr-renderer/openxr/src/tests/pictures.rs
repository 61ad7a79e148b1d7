//! Pictures drawn or copied into a headset's images, on the stand-in runtime with the machine's own Vulkan.

use std::sync::Arc;

use ash::vk;
use glam::{Quat, Vec3};
use openxr::SwapchainUsageFlags as Usage;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::gaussian::{Gaussian, PackedGaussian};
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::Commands;

use super::*;
use crate::copies::ImageLayers;
use crate::eyes::{EyePicture, FAR, NEAR, RenderPath, Surround};
use crate::fake::World;

pub(super) const SIZE: [u32; 2] = [320, 240];

/// A frame that was shown.
pub(super) struct Seen {
    pub(super) way: RenderPath,
    pub(super) eyes: [EyePicture; 2],
    /// As it was submitted to the compositor.
    layers: String,
    /// Both eyes' depth images, all of them, where the compositor got depth.
    pub(super) depths: Option<Vec<f32>>,
}

/// How a frame is made.
#[derive(Clone, Copy)]
pub(super) struct Made {
    pub(super) back_end: BackEnd,
    pub(super) surround: Surround,
    /// Of full resolution.
    pub(super) share: f32,
}

/// Quads before the viewer's room, at full resolution.
pub(super) const QUADS: Made = Made {
    back_end: BackEnd::Quads,
    surround: Surround::Room,
    share: 1.0,
};

/// Shows Gaussians in three frames on a runtime that was changed, and returns the last; nothing without Vulkan.
pub(super) fn show(
    change: impl FnOnce(&mut World),
    made: Made,
    gaussians: &[PackedGaussian],
) -> Option<Seen> {
    let fake = everything();
    fake.set(change);
    let headset = open_sized(&fake, SIZE)?;
    let options = SessionOptions {
        room: true,
        read_back: true,
        display_hz: None,
    };
    let mut session = Session::new(&headset, options).expect("a session");
    session.poll().expect("polled");
    let count = u32::try_from(gaussians.len()).expect("a few");
    let options = RendererOptions {
        depth: session.takes_depth(),
        back_end: Some(made.back_end),
        ..RendererOptions::new(count, SIZE[0], SIZE[1], 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options).expect("renderer");
    renderer.set_foreground(gaussians).expect("they fit");
    let mut eyes = None;
    for _ in 0..3 {
        let frame = session.wait().expect("waited");
        let seen = session.locate_views(&frame).expect("looked").expect("eyes");
        let cameras = seen.cameras.map(|camera| camera.scaled(made.share));
        let parts = [Part::here(Foreground::Set)];
        let drawing = Drawing::new(&cameras, &parts);
        let mut canvas = session.canvas(&seen, made.surround, true).expect("canvas");
        renderer.draw_onto(&drawing, &mut canvas).expect("drawn");
        eyes = session.show(frame).expect("shown");
    }
    let layers = fake.set(|world| world.frames.last().map(|frame| frame.layers.concat()));
    let way = session.render_path().expect("a way");
    if let RenderPath::Direct { .. } = way {
        let error = renderer.read_back(0).expect_err("it is not there");
        assert!(matches!(error, RenderError::NotKept), "{error}");
    } else {
        renderer.read_back(0).expect("the renderer's own picture");
    }
    let seen = Seen {
        way,
        eyes: eyes.expect("pictures"),
        layers: layers.expect("a frame"),
        depths: session.takes_depth().then(|| depths(&headset, &session)),
    };
    drop((renderer, session));
    assert_eq!(headset.gpu().validation_messages(), 0, "validation");
    assert_eq!(fake.alive("swapchain"), 0, "swapchains left");
    Some(seen)
}

/// What the image holds that was shown third.
fn depths(headset: &Headset, session: &Session) -> Vec<f32> {
    let images = session.images().depth.as_ref().expect("depth images");
    let count = (images.extent.width * images.extent.height * 2) as usize;
    let usage = vk::BufferUsageFlags::empty();
    let (gpu, bytes) = (headset.gpu(), count as u64 * 4);
    let buffer = Buffer::new(gpu, "depths", bytes, usage, MemoryUsage::ReadBack).expect("a buffer");
    let layers = ImageLayers {
        image: images.images()[2],
        aspect: vk::ImageAspectFlags::DEPTH,
        rest: vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        size: images.extent,
    };
    let mut commands = Commands::new(gpu).expect("commands");
    commands
        .run("looking", |commands| {
            layers.record_read(gpu, commands, &buffer);
        })
        .expect("looked");
    buffer.read(count)
}

fn ball(position: Vec3, size: f32, opacity: f32) -> Gaussian {
    Gaussian {
        position: position.to_array(),
        rotation: Quat::IDENTITY.to_array(),
        scale: [size; 3],
        opacity,
        colour: [0.9, 0.5, 0.2],
    }
}

/// A cloud before the eyes, 1.6 m above the floor, of all colours, through much of which one sees.
pub(super) fn cloud() -> Vec<PackedGaussian> {
    let mut state = 1u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let gaussians = (0..400).map(|_| {
        let place = Vec3::from_array(std::array::from_fn(|_| random() - 0.5));
        let position = Vec3::new(0.0, 1.6, -1.5) + place * Vec3::new(1.6, 1.2, 0.8);
        let turn = Quat::from_rotation_y(6.0 * random()) * Quat::from_rotation_x(6.0 * random());
        Gaussian {
            rotation: turn.to_array(),
            scale: std::array::from_fn(|_| 0.01 + 0.05 * random()),
            colour: std::array::from_fn(|_| random()),
            ..ball(position, 0.0, 0.1 + 0.85 * random())
        }
    });
    gaussians.map(|one| PackedGaussian::from(&one)).collect()
}

/// Peak signal to noise of one picture's bytes against another's, dB, and the greatest difference.
fn compared(one: &[EyePicture; 2], other: &[EyePicture; 2]) -> (f64, u8) {
    let (mut squares, mut most, mut count) = (0.0, 0, 0u32);
    for (one, other) in one.iter().zip(other) {
        assert_eq!(one.rgba.len(), other.rgba.len(), "as large");
        for (a, b) in one.rgba.iter().zip(&other.rgba) {
            let apart = a.abs_diff(*b);
            squares += f64::from(apart).powi(2);
            most = most.max(apart);
            count += 1;
        }
    }
    let mean = (squares / f64::from(count)).max(1e-9);
    (10.0 * (255.0 * 255.0 / mean).log10(), most)
}

/// Makes a runtime's images such that they can only be copied to.
pub(super) fn only_copied(world: &mut World) {
    world.refused_usage = Usage::COLOR_ATTACHMENT | Usage::DEPTH_STENCIL_ATTACHMENT;
}

pub(super) const DIRECT: RenderPath = RenderPath::Direct { foveated: false };

#[test]
fn quads_drawn_directly_into_the_images_equal_those_that_are_composed_and_copied() {
    let cloud = cloud();
    // RGBA and BGRA, in the sRGB curve and linear; and D32_SFLOAT.
    for format in [43, 50, 37, 44] {
        for surround in [Surround::Room, Surround::Studio, Surround::Scene] {
            let made = Made { surround, ..QUADS };
            let formats = vec![format, 126];
            let given = |world: &mut World| world.formats.clone_from(&formats);
            let Some(direct) = show(given, made, &cloud) else {
                return;
            };
            let copied = |world: &mut World| {
                given(world);
                only_copied(world);
            };
            let copied = show(copied, made, &cloud).expect("Vulkan is there");
            assert_eq!(
                (direct.way, copied.way),
                (DIRECT, RenderPath::Copied),
                "ways"
            );
            assert_eq!(
                direct.layers, copied.layers,
                "the layers for the compositor"
            );
            let (db, most) = compared(&direct.eyes, &copied.eyes);
            println!("format {format}, {surround:?}: {db:.1} dB, {most} of 255 at most");
            assert!(
                db >= 55.0 && most <= 2,
                "format {format}, {surround:?}: {db:.1} dB, {most} of 255"
            );
            let shows = direct.eyes.iter().all(|eye| {
                let alphas = eye.rgba.chunks_exact(4).map(|pixel| pixel[3]);
                let through = alphas.clone().filter(|alpha| (1..255).contains(alpha));
                through.count() > 5_000 || surround != Surround::Room && alphas.min() == Some(255)
            });
            assert!(shows, "{surround:?}: a cloud");
        }
    }
}

#[test]
fn the_compositor_gets_the_depth_of_each_pixel_on_either_path() {
    let distance = 2.0f32;
    // Straight ahead of the left eye, which is 3.2 cm beside the middle.
    let ball = ball(Vec3::new(-0.032, 1.6, -distance), 0.05, 0.98);
    let ball = [PackedGaussian::from(&ball)];
    let tiles = Made {
        back_end: BackEnd::Tiles,
        ..QUADS
    };
    let plain: fn(&mut World) = |_| {};
    for (change, made, way) in [
        (plain, QUADS, DIRECT),
        (only_copied, QUADS, RenderPath::Copied),
        (plain, tiles, RenderPath::Copied),
    ] {
        let Some(seen) = show(change, made, &ball) else {
            return;
        };
        assert_eq!(seen.way, way, "the way");
        assert!(seen.layers.contains("DEPTH_INFO"), "{}", seen.layers);
        let depths = seen.depths.expect("depth");
        let (mut nearest, mut far) = (1.0f32, 0);
        for depth in &depths[..depths.len() / 2] {
            nearest = nearest.min(*depth);
            far += usize::from(*depth == 1.0);
        }
        let expected = FAR * (distance - NEAR) / (distance * (FAR - NEAR));
        assert!(
            (nearest - expected).abs() < 1e-4,
            "{way}: {nearest}, not {expected}"
        );
        assert!(far > depths.len() / 3, "{way}: nothing is around the ball");
    }
}

#[test]
fn pictures_of_less_resolution_lie_in_the_upper_left_of_the_images_on_either_path() {
    let cloud = cloud();
    let half = Made {
        share: 0.5,
        surround: Surround::Studio,
        ..QUADS
    };
    let Some(direct) = show(|_| {}, half, &cloud) else {
        return;
    };
    let copied = show(only_copied, half, &cloud).expect("Vulkan is there");
    assert_eq!(
        (direct.way, copied.way),
        (DIRECT, RenderPath::Copied),
        "ways"
    );
    assert_eq!(
        direct.layers, copied.layers,
        "the layers for the compositor"
    );
    assert_eq!([direct.eyes[0].width, direct.eyes[0].height], [160, 120]);
    let (db, most) = compared(&direct.eyes, &copied.eyes);
    assert!(db >= 55.0 && most <= 2, "{db:.1} dB, {most} of 255");
}

#[test]
fn without_drawable_depth_images_the_whole_picture_is_copied() {
    let refused = |world: &mut World| world.refused_usage = Usage::DEPTH_STENCIL_ATTACHMENT;
    let Some(seen) = show(refused, QUADS, &cloud()) else {
        return;
    };
    assert_eq!(seen.way, RenderPath::Copied, "the way");
    assert!(seen.depths.is_some(), "with depth");
}

#[test]
fn a_compositor_without_depth_gets_no_depth() {
    let without = |world: &mut World| {
        world
            .extensions
            .retain(|name| *name != "XR_KHR_composition_layer_depth");
    };
    let Some(seen) = show(without, QUADS, &cloud()) else {
        return;
    };
    assert_eq!(seen.way, DIRECT, "the way");
    assert!(!seen.layers.contains("DEPTH_INFO"), "{}", seen.layers);
}

#[test]
fn a_device_without_density_maps_is_given_plain_images_and_draws_into_them() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    assert!(!headset.gpu().features().density_maps, "not in software");
    let session = begun(&headset);
    let granted = headset.extensions().has("XR_FB_foveation");
    assert!(granted, "the runtime would");
    let made = fake.calls("xrCreateSwapchain");
    assert!(made.iter().all(|it| !it.contains("FOVEATION")), "{made:?}");
    assert_eq!(fake.calls("xrUpdateSwapchainFB").len(), 0, "no profile");
    drop(session);
}

#[test]
fn a_frame_with_an_unused_canvas_ends_without_a_picture() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    for _ in 0..2 {
        let frame = session.wait().expect("waited");
        let eyes = session.locate_views(&frame).expect("looked").expect("eyes");
        drop(session.canvas(&eyes, Surround::Studio, false));
        let pictures = session.show(frame).expect("ended");
        assert!(pictures.is_none(), "nothing to read");
    }
    assert_eq!(session.render_path(), None, "no picture came any way");
    let frames = fake.set(|world| std::mem::take(&mut world.frames));
    for frame in frames {
        let layers = frame.layers.concat();
        assert!(!layers.contains("PROJECTION"), "{layers}");
    }
}

#[test]
fn a_picture_larger_than_the_images_is_refused() {
    let fake = everything();
    let Some(headset) = open(&fake) else { return };
    let mut session = begun(&headset);
    let options = RendererOptions::new(10, 128, 128, 2);
    let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options).expect("renderer");
    let frame = session.wait().expect("waited");
    let eyes = session.locate_views(&frame).expect("looked").expect("eyes");
    let cameras = eyes.cameras.map(|camera| camera.scaled(2.0));
    let mut canvas = session
        .canvas(&eyes, Surround::Room, false)
        .expect("canvas");
    let error = renderer
        .draw_onto(&Drawing::new(&cameras, &[]), &mut canvas)
        .expect_err("too large");
    assert!(error.to_string().contains("at most 64x64"), "{error}");
    session.skip(frame).expect("ended");
}

#[test]
fn back_ends_are_compared_again_for_a_headsets_pictures() {
    let fake = everything();
    let Some(headset) = open_sized(&fake, SIZE) else {
        return;
    };
    let gpu = headset.gpu();
    if !(gpu.has_clock() && BackEnd::Quads.runs_on(gpu)) {
        println!("skipped: nothing to compare on this device");
        return;
    }
    let mut session = begun(&headset);
    let cloud = cloud();
    let options = RendererOptions::new(400, SIZE[0], SIZE[1], 2);
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("renderer");
    renderer.set_foreground(&cloud).expect("they fit");
    let (mut trials, mut ways) = (Vec::new(), Vec::new());
    for _ in 0..3 {
        let frame = session.wait().expect("waited");
        let eyes = session.locate_views(&frame).expect("looked").expect("eyes");
        if trials.is_empty() {
            renderer.draw(&eyes.cameras).expect("drawn");
            trials.push(renderer.back_end_trial().expect("compared"));
        }
        let parts = [Part::here(Foreground::Set)];
        let mut canvas = session
            .canvas(&eyes, Surround::Room, false)
            .expect("canvas");
        let drawing = Drawing::new(&eyes.cameras, &parts);
        renderer.draw_onto(&drawing, &mut canvas).expect("drawn");
        session.show(frame).expect("shown");
        trials.push(renderer.back_end_trial().expect("compared"));
        ways.push(session.render_path().expect("a way"));
    }
    assert_ne!(trials[0], trials[1], "compared anew");
    assert_eq!(trials[1..], [trials[1]; 3], "and once");
    let way = match trials[1].winner() {
        BackEnd::Tiles => RenderPath::Copied,
        BackEnd::Quads => DIRECT,
    };
    assert_eq!(ways, [way; 3], "the faster one's");
    drop((renderer, session));
    assert_eq!(headset.gpu().validation_messages(), 0, "validation");
}

#[test]
fn where_the_device_has_density_maps_pictures_of_full_size_are_drawn_by_them() {
    let Some(headset) = open(&everything()) else {
        return;
    };
    if !headset.gpu().features().density_maps {
        println!("skipped: no VK_EXT_fragment_density_map on this device");
        return;
    }
    drop(headset);
    for (share, foveated) in [(1.0, true), (0.5, false)] {
        let made = Made { share, ..QUADS };
        let seen = show(|_| {}, made, &cloud()).expect("Vulkan is there");
        assert_eq!(
            seen.way,
            RenderPath::Direct { foveated },
            "at {share} of full size"
        );
    }
}
