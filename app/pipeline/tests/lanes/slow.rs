//! An NPU that is much slower than motion: QNN's emulator.

use crate::stage::{CPU, Stage, Swing};
use app_pipeline::plan::Plan;
use app_pipeline::profile::PictureTimes;
use app_pipeline::stage::Stage as Work;
use npu_runtime::{Provider, QnnTarget};
use std::time::{Duration, Instant};
use test_support::{onnx, vulkan};

/// Draws until `shown` holds of a picture.
fn draws_until(stage: &mut Stage, shown: impl Fn(&PictureTimes) -> bool) -> bool {
    let until = Instant::now() + Duration::from_secs(60);
    while Instant::now() < until {
        stage.picture();
        if stage
            .lanes
            .collector()
            .pictures()
            .last()
            .is_some_and(&shown)
        {
            return true;
        }
    }
    false
}

#[test]
fn pictures_go_on_while_a_slow_npu_infers_and_the_cpu_takes_over_when_it_fails() {
    let Some(gpu) = vulkan::gpu() else { return };
    if onnx::runtime_with_qnn().is_none() {
        return;
    }
    let npu = Provider::Qnn {
        target: QnnTarget::SXR2230P,
    };
    let swing = Swing::new(30.0, 100_000, 0.5);
    let Some(mut stage) = Stage::new(&gpu, Plan::Npu, &[npu, CPU], swing) else {
        return;
    };
    let older = |picture: &PictureTimes| picture.from.number < picture.to.number;
    assert!(draws_until(&mut stage, older), "two states");
    let started = Instant::now();
    stage.run(Duration::from_secs(3));
    let fault = stage.lanes.fault();
    fault.strike();
    // The emulator leaves most poses out; the CPU none, and both ends of a picture are neighbours.
    let neighbours = |picture: &PictureTimes| picture.to.number == picture.from.number + 1;
    let collector = stage.lanes.collector();
    let mut inferred = 0;
    for inference in collector
        .spans()
        .filter(|span| span.stage == Work::Inference)
    {
        if inference.begin < started {
            continue;
        }
        inferred += 1;
        let meanwhile = collector
            .pictures()
            .filter(|picture| inference.begin < picture.begun && picture.displayed < inference.end);
        let meanwhile = meanwhile.count();
        assert!(
            meanwhile > 0,
            "{meanwhile} pictures were begun and shown while the NPU was busy for {:?}",
            inference.end - inference.begin
        );
    }
    assert!(inferred > 0, "nothing was inferred");
    assert!(
        !collector.pictures().any(neighbours),
        "the emulator is as fast as motion: this shows nothing"
    );
    assert!(stage.lanes.skipped().poses > 0, "poses are left out");
    assert!(
        draws_until(&mut stage, neighbours),
        "the CPU does not take over"
    );
}
