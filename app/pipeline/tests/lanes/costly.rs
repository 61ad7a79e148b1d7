//! Someone whose Gaussians no device draws in time, in the room with others.

use crate::people::shown;
use crate::stage::{CPU, Stage, Swing, camera};
use app_pipeline::error::ReceiverError;
use app_pipeline::plan::Plan;
use renderer_splat::error::RenderError;
use renderer_splat::limits::MOST_PART_PAIRS;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use std::time::{Duration, Instant};
use synthetic_person::hostile::cloud;
use test_support::vulkan;

/// So many tiles that 2,000 Gaussians which cover them are too many.
const LARGE: u32 = 1536;

/// Has tiles drawn of such pictures, with room for one more person.
fn draw_large(stage: &mut Stage, gpu: &Arc<Gpu>) {
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(stage.lanes.room_taken() + 2_256, LARGE, LARGE, 1)
    };
    let renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    stage.lanes.replace_renderer(renderer).expect("room");
}

#[test]
fn whose_gaussians_cover_too_many_tiles_is_left_out_and_the_others_go_on() {
    let Some(gpu) = vulkan::gpu() else { return };
    let at_rest = || Swing::new(30.0, 100_000, 0.0);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], at_rest()) else {
        return;
    };
    draw_large(&mut stage, &gpu);
    stage.camera = camera(LARGE);
    stage.draw_until_seen(1);
    stage.draw(3);
    let alone = shown(&mut stage);

    let joined = stage.join_as(&Arc::new(cloud(2_000, 0.49)), Plan::CpuTail, at_rest());
    assert_eq!(joined.number, 1, "the second");
    let until = Instant::now() + Duration::from_secs(60);
    while stage.lanes.present().nth(1) == Some(true) {
        stage.picture();
        assert!(Instant::now() < until, "never left out");
    }
    // The very picture in which they would have come is the others'.
    assert!(shown(&mut stage) == alone, "the first person, as before");
    assert_eq!(
        stage.lanes.poses().flatten().count(),
        1,
        "one is to be seen"
    );
    // Also whenever they are tried again.
    let until = Instant::now() + Duration::from_secs(5);
    while Instant::now() < until {
        stage.picture();
        assert!(shown(&mut stage) == alone, "the first person, as before");
    }
    let [first, second] = &stage.lanes.finish()[..] else {
        panic!("two people");
    };
    assert_eq!(first.left_out, None, "never");
    let left_out = second.left_out.expect("from the first picture on");
    assert!(left_out.pairs > MOST_PART_PAIRS.into(), "{left_out:?}");
    assert!(left_out.pictures > 3 && !left_out.for_good, "{left_out:?}");
    assert!(second.error.is_none(), "their lanes went on");
}

#[test]
fn a_picture_that_is_asked_for_by_itself_fails_where_it_would_cost_too_much() {
    let Some(gpu) = vulkan::gpu() else { return };
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], Swing::new(30.0, 1000, 0.0))
    else {
        return;
    };
    draw_large(&mut stage, &gpu);
    stage.join_as(
        &Arc::new(cloud(2_000, 0.49)),
        Plan::CpuTail,
        Swing::new(30.0, 1000, 0.0),
    );
    // Two are to be seen in a picture that was begun, and not drawn.
    let until = Instant::now() + Duration::from_secs(60);
    while stage.lanes.poses().flatten().count() < 2 {
        let tick = stage.display.tick(Instant::now());
        stage.lanes.begin(tick).expect("lanes run");
        std::thread::sleep(Duration::from_millis(5));
        assert!(Instant::now() < until, "both are never there");
    }
    let refused = stage.lanes.draw_everyone(&[camera(LARGE)]);
    let refused = refused.expect_err("too many tiles");
    let ReceiverError::Render(RenderError::CostlyPart { part, .. }) = refused else {
        panic!("{refused}");
    };
    assert_eq!(part, 1, "the second");
}
