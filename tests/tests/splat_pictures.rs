//! The renderer's pictures against the f64 reference, and inputs at the edge.
//!
//! Every test runs with the validation layer on and demands that it stays silent.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use glam::Vec3;
use mon3tr_tests::picture_check::{assert_drawn_as_reference, draw, renderer_for, show};
use mon3tr_tests::real_files::real_file;
use mon3tr_tests::splat_scenes::{captured_gaussians, eyes, front_camera, random_gaussians};
use mon3tr_tests::vulkan::{
    LOGGED_MESSAGES, assert_silent, gpu, open_gpu, or_skip, rerun_with_other_subgroups,
};
use xr_renderer::{
    Backdrop, Camera, Gaussian, Gpu, GpuChoice, RenderError, RendererOptions, Shown, Sorter,
    SplatRenderer, WindowTarget,
};

// Least PSNR in dB. Rounding to 8 bits alone is 59.

/// Few Gaussians over one another: colours in half floats and arithmetic in f32 are all that differs.
const SPARSE: f64 = 68.0;
/// Blending stops where less than 1/255 shows through, which the reference does not.
const CROWDED: f64 = 58.0;
/// The same, where nearly every pixel stops early: 48 is what losing 1/255 everywhere would give.
const OPAQUE: f64 = 50.0;

#[test]
fn twenty_thousand_random_gaussians_look_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 7);
    assert_drawn_as_reference(
        &gpu,
        "mono",
        &gaussians,
        &[front_camera(1024, 1024)],
        CROWDED,
    );
}

#[test]
fn both_eyes_see_what_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 11);
    assert_drawn_as_reference(&gpu, "stereo", &gaussians, &eyes(768, 700), CROWDED);
}

#[test]
fn a_captured_scene_looks_as_the_reference_says() {
    let Some(gpu) = gpu() else { return };
    let Some(path) = real_file("splats/playbot3.ply") else {
        return;
    };
    let bytes = std::fs::read(&path).expect("the capture can be read");
    let gaussians = captured_gaussians(&bytes);
    assert_eq!(gaussians.len(), 31_000, "Gaussians in the capture");
    let middle = gaussians
        .iter()
        .map(|gaussian| Vec3::from(gaussian.position))
        .sum::<Vec3>()
        / 31_000.0;
    // Captures stand on their head: y down, as their cameras saw it.
    let target = middle + Vec3::new(0.0, -0.45, 0.0);
    let eye = target + Vec3::new(1.1, -0.5, 2.2);
    let camera = Camera::look_at(eye, target, Vec3::NEG_Y, 0.8, 1024, 1024);
    assert_drawn_as_reference(&gpu, "captured", &gaussians, &[camera], CROWDED);
}

#[test]
fn a_picture_whose_sides_are_no_multiple_of_a_tile_is_whole() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(2_000, 3);
    assert_drawn_as_reference(&gpu, "odd", &gaussians, &[front_camera(333, 217)], SPARSE);
    assert_drawn_as_reference(&gpu, "thin", &gaussians, &[front_camera(1, 500)], SPARSE);
}

#[test]
fn a_camera_among_the_gaussians_draws_those_before_it() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(20_000, 5);
    let camera = Camera::look_at(Vec3::splat(0.05), Vec3::X, Vec3::Y, 1.2, 512, 512);
    assert_drawn_as_reference(&gpu, "within", &gaussians, &[camera], OPAQUE);
}

#[test]
fn one_gaussian_is_drawn() {
    let Some(gpu) = gpu() else { return };
    let gaussians = [Gaussian {
        position: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.3, 0.1, 0.1],
        opacity: 1.0,
        colour: [1.0, 0.5, 0.2],
    }];
    assert_drawn_as_reference(&gpu, "one", &gaussians, &[front_camera(256, 256)], SPARSE);
}

#[test]
fn many_gaussians_in_one_place_are_blended_in_the_order_of_their_index() {
    let Some(gpu) = gpu() else { return };
    // Same place, other colours: a wrong order among equals shows.
    let mut gaussians = random_gaussians(20_000, 13);
    for gaussian in &mut gaussians {
        gaussian.position = [0.1, 0.2, 0.0];
        gaussian.opacity *= 0.2;
    }
    assert_drawn_as_reference(
        &gpu,
        "identical",
        &gaussians,
        &[front_camera(512, 512)],
        CROWDED,
    );
}

#[test]
fn gaussians_larger_than_the_picture_make_the_tile_lists_grow() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(1_500, 17);
    for gaussian in &mut gaussians {
        gaussian.scale = gaussian.scale.map(|scale| 60.0 * scale);
        gaussian.opacity *= 0.05;
    }
    assert_drawn_as_reference(&gpu, "large", &gaussians, &[front_camera(512, 512)], OPAQUE);
}

#[test]
fn more_pairs_than_the_device_can_list_are_an_error_that_says_so() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(16_000, 19);
    for gaussian in &mut gaussians {
        gaussian.scale = [40.0; 3];
        gaussian.opacity = 1.0;
    }
    let mut renderer = renderer_for(&gpu, 16_000, 1024, 1024, 1);
    match show(&mut renderer, &gaussians, &[front_camera(1024, 1024)]) {
        Err(RenderError::TooManyPairs { pairs, limit }) => {
            assert!(pairs > limit, "{pairs} pairs, {limit} fit");
        }
        // A device with larger buffers may draw them.
        other => assert!(!gpu.info().is_cpu && other.is_ok(), "{other:?}"),
    }
    let few = random_gaussians(100, 1);
    show(&mut renderer, &few, &[front_camera(1024, 1024)]).expect("the renderer still draws");
    assert_silent(&gpu);
}

#[test]
fn nothing_to_draw_is_a_transparent_picture() {
    let Some(gpu) = gpu() else { return };
    let camera = front_camera(100, 100);
    let mut renderer = renderer_for(&gpu, 1_000, 100, 100, 1);
    let transparent = |renderer: &mut SplatRenderer, why: &str| {
        let image = renderer.read_back(0).expect("a picture");
        assert!(
            image.pixels().iter().flatten().all(|value| *value == 0.0),
            "{why}"
        );
    };
    transparent(&mut renderer, "before the first picture");
    let gaussians = random_gaussians(1_000, 23);
    show(&mut renderer, &gaussians, &[camera]).expect("a picture");
    show(&mut renderer, &[], &[camera]).expect("a picture of nothing");
    transparent(&mut renderer, "no Gaussians");
    let away = Camera::look_at(Vec3::Z * 3.0, Vec3::Z * 6.0, Vec3::Y, 0.75, 100, 100);
    show(&mut renderer, &gaussians, &[away]).expect("a picture of nothing");
    transparent(&mut renderer, "all behind the camera");
    assert_silent(&gpu);
}

#[test]
fn a_renderer_without_room_for_gaussians_draws_nothing() {
    let Some(gpu) = gpu() else { return };
    let image = draw(&gpu, &[], &[front_camera(64, 64)]).remove(0);
    assert!(
        image.pixels().iter().flatten().all(|value| *value == 0.0),
        "nothing drawn"
    );
    assert_silent(&gpu);
}

#[test]
fn gaussians_with_broken_numbers_are_left_out() {
    let Some(gpu) = gpu() else { return };
    let good = random_gaussians(3_000, 29);
    let mut mixed = Vec::new();
    for (index, gaussian) in good.iter().enumerate() {
        let mut broken = *gaussian;
        let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][index % 3];
        match index % 6 {
            0 => broken.position[index % 3] = value,
            1 => broken.opacity = value,
            2 => broken.rotation[index % 4] = value,
            3 => broken.scale[index % 3] = value,
            4 => broken.colour[index % 3] = value,
            _ => broken.scale = [3e38; 3],
        }
        mixed.extend([broken, *gaussian]);
    }
    let cameras = eyes(320, 320);
    let expected = draw(&gpu, &good, &cameras);
    let got = draw(&gpu, &mixed, &cameras);
    assert!(got == expected, "the broken ones change nothing");
    assert_silent(&gpu);
}

#[test]
fn the_same_input_gives_the_same_picture_to_the_last_bit() {
    let Some(gpu) = gpu() else { return };
    let mut gaussians = random_gaussians(20_000, 31);
    for gaussian in &mut gaussians[..10_000] {
        gaussian.position[2] = 0.25;
    }
    let cameras = eyes(400, 400);
    let first = draw(&gpu, &gaussians, &cameras);
    for _ in 0..3 {
        assert!(draw(&gpu, &gaussians, &cameras) == first, "another picture");
    }
    assert_silent(&gpu);
}

#[test]
fn what_does_not_fit_the_renderer_is_refused_by_name() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer_for(&gpu, 10, 64, 64, 1);
    let camera = front_camera(64, 64);
    let error = show(&mut renderer, &random_gaussians(11, 1), &[camera]).expect_err("11 of 10");
    assert!(error.to_string().contains("11 Gaussians"), "{error}");
    let error = show(&mut renderer, &[], &[camera, camera]).expect_err("2 cameras");
    assert!(
        error.to_string().contains("2 cameras for 1 view"),
        "{error}"
    );
    let error = show(&mut renderer, &[], &[front_camera(64, 32)]).expect_err("other size");
    assert!(error.to_string().contains("64x32"), "{error}");
    let mut scaled = camera;
    scaled.camera_from_world.matrix3 *= 1.5;
    let error = show(&mut renderer, &[], &[scaled]).expect_err("no rigid camera");
    assert!(error.to_string().contains("rigid"), "{error}");
    let error = renderer.read_back(1).expect_err("1 view");
    assert!(error.to_string().contains("view 1"), "{error}");
    let error = SplatRenderer::new(Arc::clone(&gpu), &RendererOptions::new(10, 5000, 64, 1))
        .expect_err("too wide");
    assert!(error.to_string().contains("5000x64"), "{error}");
    let error = SplatRenderer::new(Arc::clone(&gpu), &RendererOptions::new(u32::MAX, 64, 64, 1))
        .expect_err("too many");
    assert!(error.to_string().contains("fewer Gaussians"), "{error}");
    assert_silent(&gpu);
}

#[test]
fn a_device_that_is_not_there_is_refused_with_those_that_are() {
    let Some(gpu) = gpu() else { return };
    let wanted = GpuChoice::Named("no such device".to_owned());
    let error = Gpu::open(&wanted, false)
        .expect_err("no such device")
        .to_string();
    assert!(
        error.contains("no such device") && error.contains(&gpu.info().name),
        "{error}"
    );
}

#[test]
fn stages_are_timed_where_the_device_has_a_clock() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = renderer_for(&gpu, 20_000, 512, 512, 1);
    show(
        &mut renderer,
        &random_gaussians(20_000, 37),
        &[front_camera(512, 512)],
    )
    .expect("a picture");
    let times = renderer.stage_times();
    let stages = [
        times.upload,
        times.project,
        times.sort,
        times.bin,
        times.raster,
    ];
    assert!(
        stages
            .iter()
            .all(|stage| stage.is_finite() && *stage >= 0.0),
        "{times:?}"
    );
    assert_eq!(
        times.raster > 0.0,
        gpu.has_clock(),
        "blending is timed by the device alone: {times:?}"
    );
}

#[test]
fn a_closed_device_leaves_no_object_behind() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let image = draw(&gpu, &random_gaussians(500, 41), &eyes(128, 128)).remove(0);
    assert!(
        image.pixels().iter().any(|pixel| pixel[3] > 0.0),
        "something drawn"
    );
    Sorter::new(&gpu, 1_000)
        .and_then(|mut sorter| sorter.sort_keys(&[3, 1, 2]))
        .expect("a sort");
    assert_eq!(Arc::strong_count(&gpu), 1, "holders of the device");
    drop(gpu);
    // The layer lists leaked objects when the device and the instance go.
    assert_eq!(
        LOGGED_MESSAGES.load(Ordering::SeqCst),
        0,
        "messages (logged above)"
    );
}

#[test]
fn a_window_is_shown_pictures_while_its_size_changes() {
    let Some(gpu) = gpu() else { return };
    // Drivers without headless surfaces exist: there is no window to show anything in.
    let mut window = match WindowTarget::headless(&gpu, 300, 200) {
        Ok(window) => window,
        Err(why @ RenderError::NoPresentation { .. }) if !gpu.info().is_cpu => {
            println!("skipped: {why}");
            return;
        }
        Err(why) => panic!("{why}"),
    };
    let mut renderer = renderer_for(&gpu, 500, 64, 64, 1);
    show(
        &mut renderer,
        &random_gaussians(500, 43),
        &[front_camera(64, 64)],
    )
    .expect("a picture");
    for size in [(300, 200), (300, 200), (64, 64), (1000, 50), (1, 1)] {
        window.resize(size.0, size.1);
        for _ in 0..3 {
            let shown = window
                .present(&renderer, Backdrop::Colour([0.2; 3]))
                .expect("the window lives");
            assert_eq!(shown, Shown::Yes, "a window of {size:?}");
        }
    }
    let other = open_gpu().expect("a second device like the first");
    let stranger = renderer_for(&other, 1, 64, 64, 1);
    window
        .present(&stranger, Backdrop::Colour([0.2; 3]))
        .expect_err("a renderer on another device");
    drop(window);
    assert_silent(&gpu);
}

#[test]
fn the_picture_is_right_for_every_subgroup_size_of_the_software_driver() {
    let Some(gpu) = gpu() else { return };
    for (size, text) in rerun_with_other_subgroups(&gpu, &["_reference_says"]) {
        let expected = format!("subgroups of {size}");
        let views = text.matches(&expected).count();
        assert!(views >= 3, "at least three views with {expected}:\n{text}");
    }
}
