//! The device's life: choosing, timing, closing, and windows.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::sort::Sorter;
use renderer_splat::window::{PresentOutcome, WindowTarget};
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use test_support::picture_check::{BACK_ENDS, draw, packed, renderer_for, show};
use test_support::splat_reference::World;
use test_support::splat_scenes::{eyes, front_camera, random_gaussians, random_scene};
use test_support::vulkan::{LOGGED_MESSAGES, assert_silent, gpu, open_gpu, or_skip};

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
    let mut renderer = renderer_for(&gpu, BackEnd::Tiles, 20_000, 512, 512, 1);
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
fn stages_lie_between_submission_and_fence_on_the_hosts_clock() {
    let Some(gpu) = gpu() else { return };
    let gaussians = random_gaussians(2_000, 38);
    for back_end in BACK_ENDS {
        let mut renderer = renderer_for(&gpu, back_end, 2_000, 128, 128, 2);
        assert_eq!(renderer.picture_time(), None, "no picture yet");
        let mut last = Instant::now();
        let mut widest = Duration::ZERO;
        for picture in 0..60 {
            if picture % 2 == 0 {
                // The others keep the order.
                renderer
                    .set_foreground(&packed(&gaussians))
                    .expect("they fit");
            }
            renderer.draw(&eyes(128, 128)).expect("a picture");
            let time = renderer.picture_time().expect("a picture");
            let times = renderer.stage_times();
            let now = Instant::now();
            assert!(
                last <= time.submitted && time.submitted <= time.finished && time.finished <= now,
                "picture {picture}: {time:?}"
            );
            last = now;
            assert_eq!(time.stages.is_some(), gpu.has_clock(), "a clock");
            let Some(stages) = time.stages else { continue };
            let spans = [
                stages.upload,
                stages.project,
                stages.sort,
                stages.bin,
                stages.raster,
            ];
            let row: Vec<Instant> = std::iter::once(time.submitted)
                .chain(spans.into_iter().flatten())
                .chain([time.finished])
                .collect();
            assert!(row.is_sorted(), "picture {picture}: {row:?}");
            let raster = (stages.raster[1] - stages.raster[0]).as_secs_f64() * 1e3;
            assert!(
                (raster - times.raster).abs() < 0.001 + 2.0 * stages.within.as_secs_f64() * 1e3,
                "picture {picture}: {raster} ms against {times:?}"
            );
            // Half of what lies between submission and fence beside the stages is known without comparing clocks.
            let beside = (time.finished - time.submitted).as_secs_f64() * 1e3 - times.total();
            assert!(
                stages.within.as_secs_f64() * 1e3 <= 0.5 * beside.max(0.0) + times.upload + 0.001,
                "picture {picture}: {stages:?}"
            );
            widest = widest.max(stages.within);
        }
        println!("{back_end}: within {widest:?} at most");
    }
    assert_silent(&gpu);
}

#[test]
fn the_first_picture_finds_out_which_back_end_is_faster_and_all_are_drawn_by_it() {
    let Some(gpu) = gpu() else { return };
    let (gaussians, camera) = (random_gaussians(5_000, 39), front_camera(256, 256));
    let options = RendererOptions::new(5_000, 256, 256, 1);
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
    renderer.draw(&[camera]).expect("a picture of nothing");
    assert_eq!(
        renderer.back_end_trial(),
        None,
        "nothing to compare them with"
    );
    for picture in ["first", "second"] {
        show(&mut renderer, &gaussians, &[camera]).expect("a picture");
        let trial = renderer.back_end_trial();
        if gpu.has_clock() && BackEnd::Quads.runs_on(&gpu) {
            let trial = trial.expect("the device can tell");
            assert_eq!(renderer.back_end(), trial.winner(), "{picture}");
            assert!(trial.tiles > 0.0 && trial.quads > 0.0, "{trial:?}");
        }
        let got = renderer.read_back(0).expect("a view");
        let asked = draw(&gpu, renderer.back_end(), &World::of(&gaussians), &[camera]);
        assert!(got == asked[0], "{picture}: another than when asked for");
    }
    assert_silent(&gpu);
}

#[test]
fn a_closed_device_leaves_no_object_behind() {
    let Some(gpu) = or_skip(open_gpu()) else {
        return;
    };
    let (gaussians, scene) = (random_gaussians(500, 41), random_scene(500, 1, 42));
    let world = World {
        background: Some(&scene),
        ..World::of(&gaussians)
    };
    for back_end in BACK_ENDS {
        let image = draw(&gpu, back_end, &world, &eyes(128, 128)).remove(0);
        assert!(
            image.pixels().iter().any(|pixel| pixel[3] > 0.0),
            "{back_end}: something drawn"
        );
    }
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
        Err(why @ VulkanError::NoPresentation { .. }) if !gpu.info().is_cpu => {
            println!("skipped: {why}");
            return;
        }
        Err(why) => panic!("{why}"),
    };
    let mut renderer = renderer_for(&gpu, BackEnd::Quads, 500, 64, 64, 1);
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
            assert_eq!(shown, PresentOutcome::Presented, "a window of {size:?}");
        }
    }
    let other = open_gpu().expect("a second device like the first");
    let stranger = renderer_for(&other, BackEnd::Tiles, 1, 64, 64, 1);
    window
        .present(&stranger, Backdrop::Colour([0.2; 3]))
        .expect_err("a renderer on another device");
    drop(window);
    assert_silent(&gpu);
}
