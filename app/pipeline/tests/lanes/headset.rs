//! A device that only a headset's runtime can make again.

use crate::people::{places, plate, shown};
use crate::stage::{CPU, Stage, Swing, own_gpu};
use app_pipeline::lanes::Drawn;
use app_pipeline::plan::Plan;
use glam::Vec3;
use spmm3::MotionParams;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Begins pictures until both people's poses are others than `before`, without drawing any.
fn both_move_on(stage: &mut Stage, before: &[MotionParams; 2]) {
    let until = Instant::now() + Duration::from_secs(20);
    loop {
        let tick = stage.display.tick(Instant::now());
        stage.lanes.begin(tick).expect("lanes run");
        let moved =
            |(pose, before): (Option<&MotionParams>, _)| pose.is_some_and(|pose| pose != before);
        if stage.lanes.poses().zip(before).all(moved) {
            return;
        }
        assert!(Instant::now() < until, "poses stand still");
        let drawn = stage.lanes.draw(&[stage.camera]).expect("no error");
        assert!(matches!(drawn, Drawn::Lost), "{drawn:?} without a device");
        stage.lanes.displayed(Instant::now());
        // As the display's rhythm is.
        std::thread::sleep(tick.next_begins.saturating_duration_since(Instant::now()));
    }
}

#[test]
fn a_headsets_lost_device_is_waited_for_while_people_move_on() {
    for plan in [Plan::CpuTail, Plan::Gpu] {
        let Some(gpu) = own_gpu() else { return };
        gpu.declare_headsets();
        let swing = || Swing::new(30.0, 100_000, 0.5);
        let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], swing()) else {
            return;
        };
        stage.join(Plan::CpuTail, swing());
        for (person, place) in places().into_iter().enumerate() {
            stage.lanes.place(person, place);
        }
        stage.lanes.set_scenery(&[plate(0.0)]).expect("room");
        stage.draw_until_seen(2);
        gpu.declare_lost();
        let tick = stage.display.tick(Instant::now());
        stage.lanes.begin(tick).expect("lanes run");
        let drawn = stage.lanes.draw(&[stage.camera]).expect("no error");
        assert!(matches!(drawn, Drawn::Lost), "{plan}: {drawn:?}");
        let seen: Vec<MotionParams> = stage.lanes.poses().flatten().cloned().collect();
        let seen: [MotionParams; 2] = seen.try_into().expect("both are there");
        both_move_on(&mut stage, &seen);
        // A device that is lost before it is moved to is not the last one.
        for is_lost in [true, false] {
            let next = own_gpu().expect("as before");
            next.declare_headsets();
            if is_lost {
                next.declare_lost();
            }
            let moved = stage.lanes.move_to(Arc::clone(&next));
            if is_lost {
                let drawn = stage.lanes.draw(&[stage.camera]).expect("no error");
                assert!(matches!(drawn, Drawn::Lost), "{plan}: {drawn:?}, {moved:?}");
            } else {
                moved.expect("a device that works");
            }
        }
        let old = Arc::downgrade(&gpu);
        drop(gpu);
        stage.draw_until_seen(2);
        stage.draw(5);
        let is_bright = shown(&mut stage).iter().any(|byte| *byte > 40);
        assert!(is_bright, "{plan}: somebody is to be seen again");
        let last = *stage.lanes.collector().pictures().last().expect("one");
        assert_eq!(last.gaussians, 4_001, "{plan}: everybody, and the scenery");
        assert!(old.upgrade().is_none(), "{plan}: the lost device is let go");
    }
}

#[test]
fn a_device_that_works_is_left_for_another() {
    let Some(gpu) = own_gpu() else { return };
    let swing = Swing::new(30.0, 100_000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU], swing) else {
        return;
    };
    stage.draw(10);
    let next = own_gpu().expect("as before");
    stage.lanes.move_to(Arc::clone(&next)).expect("a device");
    stage
        .lanes
        .place(0, glam::Affine3A::from_translation(Vec3::Y * 0.1));
    stage.draw(10);
    assert!(
        Arc::ptr_eq(stage.lanes.renderer().gpu(), &next),
        "drawn there"
    );
    assert!(
        shown(&mut stage).iter().any(|byte| *byte > 40),
        "nobody there"
    );
}
