//! Units that fail in the middle of a call.

use crate::stage::BLACK;
use crate::stage::{CPU, Stage, Swing, own_gpu};
use app_pipeline::plan::Plan;
use std::time::{Duration, Instant};
use test_support::vulkan;

/// Waits until a state is shown that is newer than `number`.
fn shows_newer_than(stage: &mut Stage, number: u64) -> bool {
    let until = Instant::now() + Duration::from_secs(20);
    while Instant::now() < until {
        stage.picture();
        let newest = stage.lanes.collector().pictures().last().copied();
        if newest.is_some_and(|picture| picture.to.number > number) {
            return true;
        }
    }
    false
}

fn newest(stage: &mut Stage) -> u64 {
    let newest = stage.lanes.collector().pictures().last().copied();
    newest.expect("pictures").to.number
}

#[test]
fn a_provider_that_fails_is_replaced_by_the_next_and_the_call_goes_on() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = Swing::new(30.0, 1000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::CpuTail, &[CPU, CPU], swing) else {
        return;
    };
    stage.run(Duration::from_millis(300));
    let before = newest(&mut stage);
    stage.lanes.fault().strike();
    assert!(shows_newer_than(&mut stage, before + 5), "motion goes on");
    let changes = stage.lanes.provider_changes();
    assert_eq!(changes.len(), 1, "one provider was given up");
    assert_eq!(changes[0].reason, "made to fail", "and why");
}

#[test]
fn without_another_provider_the_error_says_what_happened() {
    let Some(gpu) = vulkan::gpu() else { return };
    let swing = Swing::new(30.0, 1000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::Npu, &[CPU], swing) else {
        return;
    };
    stage.run(Duration::from_millis(300));
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
    assert_eq!(error.to_string(), "made to fail", "the lane's own error");
}

#[test]
fn a_lost_device_is_opened_again_and_the_call_goes_on() {
    lose_the_device_of(Plan::CpuTail);
}

#[test]
fn a_lost_device_that_held_the_states_is_opened_again_and_the_call_goes_on() {
    lose_the_device_of(Plan::Gpu);
}

#[test]
fn a_lost_device_that_ran_the_networks_is_opened_again_and_the_call_goes_on() {
    lose_the_device_of(Plan::GpuAlone);
}

fn lose_the_device_of(plan: Plan) {
    let Some(gpu) = own_gpu() else { return };
    let swing = Swing::new(30.0, 1000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, plan, &[CPU], swing) else {
        return;
    };
    stage.run(Duration::from_millis(300));
    let before = newest(&mut stage);
    gpu.declare_lost();
    assert!(shows_newer_than(&mut stage, before + 5), "motion goes on");
    let image = stage.lanes.renderer().read_back(0).expect("a picture");
    assert!(
        image.over(BLACK).iter().any(|byte| *byte > 40),
        "and somebody is to be seen"
    );
}
