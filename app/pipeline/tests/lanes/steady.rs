//! What a call does once it runs.

use crate::people::{places, plate};
use crate::stage::{BLACK, CPU, SIDE, Stage, Swing};
use app_pipeline::lanes::{FinishedPerson, Next, Tick};
use app_pipeline::plan::Plan;
use app_pipeline::quality::QualityMode;
use glam::{Affine3A, Vec3};
use std::time::{Duration, Instant};
use test_support::allocations::allocations as counted;
use test_support::vulkan;

#[test]
fn no_lane_allocates_once_the_call_runs() {
    let Some(gpu) = vulkan::gpu() else { return };
    for plan in Plan::ALL {
        let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], Swing::new(30.0, 1000, 0.5)) else {
            return;
        };
        stage.draw(60);
        let before = counted();
        stage.draw(60);
        let allocations = counted() - before;
        assert_eq!(allocations, 0, "{plan}: allocations in 60 pictures");
    }
}

#[test]
fn two_people_who_walk_about_with_their_shadows_allocate_nothing_either() {
    let Some(gpu) = vulkan::gpu() else { return };
    for plan in [Plan::CpuTail, Plan::Gpu] {
        let swing = || Swing::new(30.0, 100_000, 0.5);
        let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], swing()) else {
            return;
        };
        stage.join(Plan::Npu, swing());
        let walk = |stage: &mut Stage| {
            for step in 0..60u8 {
                let x = f32::from(step) * 0.01;
                for (person, place) in places().into_iter().enumerate() {
                    let step = Affine3A::from_translation(Vec3::X * x);
                    stage.lanes.place(person, step * place);
                }
                let shadows = [plate(x), plate(-x), plate(0.0)];
                let some = &shadows[..usize::from(step) % 3 + 1];
                stage.lanes.set_scenery(some).expect("room");
                stage.draw(1);
            }
        };
        stage.draw_until_seen(2);
        walk(&mut stage);
        let before = counted();
        walk(&mut stage);
        let allocations = counted() - before;
        assert_eq!(allocations, 0, "{plan}: allocations in 60 pictures");
        assert_eq!(stage.lanes.poses().flatten().count(), 2, "both are there");
    }
}

#[test]
fn a_picture_that_is_done_sooner_than_expected_has_the_next_ones_gaussians_made_sooner() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = Swing::new(30.0, 100_000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], swing) else {
        return;
    };
    stage.draw_until_seen(1);
    // A display that says when the next picture is shown, and one that does not.
    for says in [false, true] {
        let until = Instant::now() + Duration::from_secs(60);
        let mut new = 0;
        while new < 5 {
            // The next picture is not expected before the test is over.
            let (now, far) = (Instant::now(), Duration::from_secs(3600));
            let tick = Tick {
                predicted: now,
                next_begins: now + far,
                next: now + far,
                period: far,
            };
            let _ = stage.lanes.begin(tick).expect("lanes run");
            stage.lanes.draw(&[stage.camera]).expect("a picture");
            let (begins, displayed) = (Instant::now(), Instant::now());
            if says {
                let next = Next { begins, displayed };
                stage.lanes.displayed_before(displayed, next);
            } else {
                stage.lanes.displayed(displayed);
            }
            let last = *stage.lanes.collector().pictures().last().expect("one");
            new += u32::from(!last.repeated);
            assert!(Instant::now() < until, "{new} pictures with new Gaussians");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn motion_that_comes_faster_than_it_can_be_shown_is_left_out_and_never_waited_for() {
    let Some(gpu) = vulkan::gpu() else { return };
    let Some(mut stage) = Stage::new(&gpu, Plan::Cpu, &[CPU], Swing::new(2000.0, 4000, 0.5)) else {
        return;
    };
    stage.run(Duration::from_secs(1));
    let pictures: Vec<_> = stage.lanes.collector().pictures().copied().collect();
    let last = pictures.last().expect("pictures");
    let waited = last.to.inference[0] - last.to.released;
    assert!(
        waited < Duration::from_millis(200),
        "poses queue up: {waited:?} before the NPU lane takes one"
    );
    let newest = last.to.number;
    let FinishedPerson {
        source, collector, ..
    } = stage.lanes.finish().swap_remove(0);
    let swing = source.expect("the lanes end");
    let frames = 4000 - swing.left;
    let inferred = collector
        .spans()
        .filter(|span| span.stage == app_pipeline::stage::Stage::Inference);
    let inferred = inferred.count() as u64;
    assert!(
        inferred < frames,
        "{inferred} of {frames} motion frames were taken"
    );
    assert!(
        newest > inferred,
        "the newest shown is {newest}, of {inferred} taken"
    );
}

#[test]
fn quality_is_given_up_for_a_rate_that_cannot_be_held_and_nothing_is_hidden() {
    let Some(gpu) = vulkan::gpu() else { return };
    for plan in [Plan::CpuTail, Plan::Gpu] {
        let swing = Swing::new(30.0, 1000, 0.5);
        // No software draws a picture in a millisecond.
        let display = (1000.0, QualityMode::Adapt);
        let Some(mut stage) = Stage::on_display(&gpu, plan, &[CPU], swing, display) else {
            return;
        };
        stage.run(Duration::from_secs(3));
        let figures = stage.lanes.quality_figures();
        assert!(figures.quality.step > 0, "{plan}: {figures:?}");
        assert!(figures.missed_periods > 0, "{plan}: misses are counted");
        let last = *stage.lanes.collector().pictures().last().expect("pictures");
        assert!(last.scale < 1.0, "{plan}: drawn at {}", last.scale);
        assert!(
            last.gaussians < 2_000 || figures.quality.level == 0,
            "{plan}: {} Gaussians at {:?}",
            last.gaussians,
            figures.quality
        );
        let image = stage.lanes.renderer().read_back(0).expect("a picture");
        assert!(
            image.width() < SIDE,
            "{plan}: {} pixels wide",
            image.width()
        );
        let bytes = image.over(BLACK);
        assert!(bytes.iter().any(|byte| *byte > 40), "{plan}: nobody there");
    }
}
