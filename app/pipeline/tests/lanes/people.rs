//! Several people by one renderer.

use crate::stage::{BLACK, CPU, SIDE, Stage, Swing, avatar};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::deform::Deformer;
use app_pipeline::error::ReceiverError;
use app_pipeline::inference::Inference;
use app_pipeline::lanes::{Joined, MotionSource};
use app_pipeline::plan::Plan;
use app_pipeline::profile::Collector;
use app_pipeline::profile::Profile;
use app_pipeline::quality::QualityMode;
use app_pipeline::stage::Stage as Work;
use glam::{Affine3A, Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{Gaussian, PackedGaussian};
use spmm3::MotionParams;
use spmm3::networks::GraphParts;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};
use test_support::{onnx, vulkan};

/// Both in the picture, one half behind the other.
pub(crate) fn places() -> [Affine3A; 2] {
    [
        (0.5, Vec3::new(-0.3, 0.0, 0.2)),
        (-0.9, Vec3::new(0.35, 0.1, -0.1)),
    ]
    .map(|(turn, at)| Affine3A::from_rotation_translation(Quat::from_rotation_y(turn), at))
}

/// A plate on the floor.
pub(crate) fn plate(x: f32) -> PackedGaussian {
    PackedGaussian::from(&Gaussian {
        position: [x, 0.05, 0.3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [0.3, 0.01, 0.2],
        opacity: 0.9,
        colour: [0.2, 0.9, 0.3],
    })
}

fn carried(gaussian: &PackedGaussian, world_from_person: Affine3A) -> PackedGaussian {
    let gaussian = gaussian.unpacked();
    let (_, turn, _) = world_from_person.to_scale_rotation_translation();
    let at = Vec3::from_array(gaussian.position);
    PackedGaussian::from(&Gaussian {
        position: world_from_person.transform_point3(at).to_array(),
        rotation: (turn * Quat::from_array(gaussian.rotation)).to_array(),
        ..gaussian
    })
}

/// What people at rest in these places look like, with some scenery, as one foreground in the world.
fn expected(
    gpu: &Arc<Gpu>,
    camera: Camera,
    places: &[Affine3A],
    scenery: &[PackedGaussian],
) -> Vec<u8> {
    let (runtime, avatar) = (onnx::runtime().expect("as before"), Arc::new(avatar()));
    let graph = GraphParts::Skinned;
    let inference = Inference::open(
        &runtime,
        &avatar,
        graph,
        &[CPU],
        &CompiledSources::default(),
    )
    .expect("a session");
    let mut deformer = Deformer::new(&avatar, inference, Plan::CpuTail).expect("a deformer");
    let state = deformer.deform(&MotionParams::default(), &mut Profile::default());
    let person = state.expect("deformed").packed();
    let people = places
        .iter()
        .flat_map(|place| person.iter().map(|one| carried(one, *place)));
    let all: Vec<_> = people.chain(scenery.iter().copied()).collect();
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(u32::try_from(all.len()).expect("few"), SIDE, SIDE, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    renderer.set_foreground(&all).expect("they fit");
    renderer.draw(&[camera]).expect("a picture");
    renderer.read_back(0).expect("a picture").over(BLACK)
}

pub(crate) fn shown(stage: &mut Stage) -> Vec<u8> {
    let image = stage.lanes.renderer().read_back(0).expect("a picture");
    image.over(BLACK)
}

/// In dB.
fn psnr(one: &[u8], other: &[u8]) -> f64 {
    assert_eq!(one.len(), other.len(), "one size");
    let squares = one
        .iter()
        .zip(other)
        .map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    let mean = squares.sum::<f64>() / one.len() as f64;
    10.0 * (255.0 * 255.0 / mean).log10()
}

#[test]
fn two_people_are_drawn_together_each_in_their_place() {
    let Some(gpu) = vulkan::gpu() else { return };
    for (plan, other) in [(Plan::CpuTail, Plan::Npu), (Plan::Gpu, Plan::CpuTail)] {
        let at_rest = || Swing::new(30.0, 1000, 0.0);
        let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], at_rest()) else {
            return;
        };
        let joined = stage.join(other, at_rest()).number;
        assert_eq!(joined, 1, "the second");
        let [first, second] = places();
        stage.lanes.place(0, first);
        stage.lanes.place(1, second);
        stage.lanes.set_scenery(&[plate(0.1)]).expect("room");
        stage.draw_until_seen(2);
        let together = shown(&mut stage);
        let likeness = psnr(
            &together,
            &expected(&gpu, stage.camera, &places(), &[plate(0.1)]),
        );
        assert!(likeness > 45.0, "{plan} and {other}: {likeness:.1} dB");
        let last = *stage.lanes.collector().pictures().last().expect("one");
        assert_eq!(last.gaussians, 4_001, "two people and a plate");
        // It would not show a mistake if they were hard to tell from others.
        let [there, here] = places();
        for wrong in [&[first][..], &[second], &[here, there, there]] {
            let likeness = psnr(&together, &expected(&gpu, stage.camera, wrong, &[]));
            assert!(likeness < 30.0, "{likeness:.1} dB like something else");
        }
        // Somewhere else from the next picture on.
        stage.lanes.place(1, first * second);
        stage.lanes.set_scenery(&[plate(-0.2)]).expect("room");
        stage.draw(1);
        let elsewhere = expected(&gpu, stage.camera, &[first, first * second], &[plate(-0.2)]);
        let likeness = psnr(&shown(&mut stage), &elsewhere);
        assert!(
            likeness > 45.0,
            "{plan} and {other}: {likeness:.1} dB, moved"
        );
    }
}

#[test]
fn a_person_who_is_not_there_yet_is_left_out_and_not_waited_for() {
    let Some(gpu) = vulkan::gpu() else { return };
    let at_rest = Swing::new(30.0, 1000, 0.0);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], at_rest) else {
        return;
    };
    stage.join(Plan::CpuTail, Swing::silent());
    stage.draw(30);
    let seen: Vec<bool> = stage.lanes.poses().map(|pose| pose.is_some()).collect();
    assert_eq!(seen, [true, false], "who is there");
    let alone = expected(&gpu, stage.camera, &[Affine3A::IDENTITY], &[]);
    let likeness = psnr(&shown(&mut stage), &alone);
    assert!(likeness > 45.0, "{likeness:.1} dB like one person");
}

#[test]
fn a_person_who_leaves_goes_out_of_the_picture_and_the_others_stay() {
    let Some(gpu) = vulkan::gpu() else { return };
    for leaves in [0, 1] {
        let swings = [(); 2].map(|()| Swing::new(30.0, 100_000, 0.5));
        let hangs_up = Arc::clone(&swings[leaves].hangs_up);
        let [first, second] = swings;
        let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], first) else {
            return;
        };
        stage.join(Plan::CpuTail, second);
        stage.draw_until_seen(2);
        hangs_up.store(true, Relaxed);
        stage.draw_until_seen(1);
        stage.draw(10);
        let seen: Vec<bool> = stage.lanes.poses().map(|pose| pose.is_some()).collect();
        assert_eq!(seen, [leaves != 0, leaves != 1], "who is there");
        assert!(!stage.lanes.is_over(), "one goes on");
        let finished = stage.lanes.finish();
        let over = (finished.iter()).map(|one| one.source.as_ref().expect("a source").is_over());
        let over: Vec<bool> = over.collect();
        assert_eq!(over, [leaves == 0, leaves == 1], "both come back");
        let [stayed, left] = [1 - leaves, leaves].map(|one| &finished[one].collector);
        let last = |collector: &Collector| collector.pictures().last().map(|one| one.number);
        assert!(last(left).is_some(), "pictures of each are recorded");
        assert!(last(left) < last(stayed), "while they are in them");
        for stage in [Work::Inference, Work::Project] {
            let is_recorded = |collector: &Collector| {
                let mut spans = collector.spans();
                spans.any(|span| span.stage == stage)
            };
            assert!(
                is_recorded(left) && is_recorded(stayed),
                "{stage:?} of each"
            );
        }
    }
}

#[test]
fn a_person_whose_lane_fails_is_left_out_and_the_last_ones_error_is_returned() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = || Swing::new(30.0, 100_000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], swing()) else {
        return;
    };
    stage.join(Plan::CpuTail, swing());
    stage.draw_until_seen(2);
    stage.lanes.fault_of(1).expect("joined").strike();
    stage.draw_until_seen(1);
    stage.draw(10);
    stage.lanes.fault().strike();
    let until = Instant::now() + Duration::from_secs(20);
    let error = loop {
        let tick = stage.display.tick(Instant::now());
        if let Err(error) = stage.lanes.begin(tick) {
            break error;
        }
        assert!(Instant::now() < until, "nobody told");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(matches!(error, ReceiverError::Struck), "{error}");
    let finished = stage.lanes.finish();
    assert!(
        finished.iter().all(|one| one.source.is_some()),
        "both sources"
    );
    let told = finished[1].error.as_ref();
    assert!(matches!(told, Some(ReceiverError::Struck)), "{told:?}");
}

#[test]
fn people_and_scenery_beyond_what_the_renderer_was_made_for_are_refused() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = || Swing::new(30.0, 1000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], swing()) else {
        return;
    };
    let mut join = |plan: Plan| {
        let (runtime, avatar) = (onnx::runtime().expect("as before"), Arc::new(avatar()));
        let inference = Inference::open(
            &runtime,
            &avatar,
            GraphParts::Networks,
            &[CPU],
            &CompiledSources::default(),
        );
        (stage.lanes).join(&avatar, Some(inference.expect("a session")), swing(), plan)
    };
    for plan in [Plan::Gpu, Plan::GpuAlone] {
        let refused = join(plan);
        assert!(matches!(refused, Err(ReceiverError::PosedTwice)), "{plan}");
    }
    assert!(
        matches!(join(Plan::Cpu), Ok(Joined { number: 1, .. })),
        "room for two"
    );
    let too_many = |error| {
        let room = RenderError::TooManyGaussians {
            count: 6_000,
            limit: 4_256,
        };
        format!("{error:?}") == format!("{:?}", ReceiverError::Render(room))
    };
    assert!(join(Plan::Cpu).is_err_and(too_many), "and not for three");
    let plates = [plate(0.0); 257];
    let lanes = &mut stage.lanes;
    assert!(
        lanes.set_scenery(&plates[..256]).is_ok(),
        "room for scenery"
    );
    assert!(lanes.set_scenery(&plates).is_err(), "and no more");
    stage.draw_until_seen(2);
}

#[test]
fn two_people_lose_quality_together() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = || Swing::new(30.0, 1000, 0.5);
    // No software draws a picture in a millisecond.
    let display = (1000.0, QualityMode::Adapt);
    let stage = Stage::on_display(&gpu, Plan::CpuTail, &[CPU], swing(), display);
    let Some(mut stage) = stage else { return };
    stage.join(Plan::CpuTail, swing());
    stage.draw_until_seen(2);
    let until = Instant::now() + Duration::from_secs(60);
    let few = loop {
        stage.picture();
        let last = *stage.lanes.collector().pictures().last().expect("one");
        if stage.lanes.quality_figures().quality.level == 3 && last.gaussians < 2_000 {
            break last.gaussians;
        }
        assert!(
            Instant::now() < until,
            "{:?}",
            stage.lanes.quality_figures()
        );
    };
    assert_eq!(few, 2 * 700, "35 % of each");
}

#[test]
fn a_newcomer_takes_the_number_of_one_who_is_gone_and_each_is_recorded() {
    let Some(gpu) = vulkan::gpu() else { return };
    let at_rest = || Swing::new(30.0, 1_000_000, 0.0);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], at_rest()) else {
        return;
    };
    let taken = stage.lanes.room_taken();
    // There is room for two: again and again another one comes and goes.
    let mut replaced = Vec::new();
    for round in 1..=5u64 {
        let guest = at_rest();
        let hangs_up = Arc::clone(&guest.hangs_up);
        let joined = stage.join(Plan::CpuTail, guest);
        assert_eq!(joined.number, 1, "round {round}");
        assert_eq!(joined.replaced.is_some(), round > 1, "round {round}");
        replaced.extend(joined.replaced);
        stage.draw_until_seen(2);
        assert!(stage.lanes.present().eq([true, true]));
        assert!(stage.lanes.attending().eq([true, true]));
        hangs_up.store(true, Relaxed);
        stage.draw_until_seen(1);
        assert!(stage.lanes.present().eq([true, false]));
        assert_eq!(stage.lanes.room_taken(), taken, "their room is free");
    }
    assert!(!stage.lanes.is_over(), "one has stayed");
    let finished = stage.lanes.finish();
    assert_eq!(finished.len(), 2, "who was there last, by number");
    assert_eq!(replaced.len(), 4, "the others were handed out");
    for person in finished.iter().chain(&replaced) {
        assert!(person.source.is_some(), "their source is given back");
        assert!(person.error.is_none(), "{:?}", person.error);
        assert!(person.collector.pictures().count() > 0, "they were seen");
    }
    let longest = finished[0].collector.pictures().count();
    let others = finished[1..].iter().chain(&replaced);
    assert!(
        others
            .map(|one| one.collector.pictures().count())
            .all(|count| count < longest),
        "the one who stayed is the first"
    );
}
