//! Placing that is interrupted, as a headset's system does: at any moment, for a while or for good.

use crate::stage::{CPU, avatar, camera, own_gpu};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::inference::Inference;
use app_pipeline::placement::{InferenceBackends, place_first};
use app_pipeline::plan::{PlacementRequest, Plan};
use npu_runtime::{Cancel, Runtime, RuntimeError};
use renderer_splat::options::RendererOptions;
use renderer_vulkan::gpu::Gpu;
use spmm3::Avatar;
use spmm3::networks::GraphParts;
use std::sync::Arc;
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};
use test_support::onnx;

/// Longer than any step takes on a slow machine that does much else.
const PATIENCE: Duration = Duration::from_secs(20);

/// Pixels of a picture's side: large enough for placing to take its time.
const SIDE: u32 = 512;

/// The pause that lasts longer than all of an undisturbed placing; placing is in the middle of its work then.
const LONG: u32 = 3;

/// The placements that could be had.
type Granted = Vec<Plan>;

/// What placing needs.
struct Preparations {
    runtime: Runtime,
    gpu: Arc<Gpu>,
    avatar: Arc<Avatar>,
}

impl Preparations {
    fn new() -> Option<Self> {
        Some(Self {
            runtime: onnx::runtime()?,
            gpu: own_gpu()?,
            avatar: Arc::new(avatar()),
        })
    }

    /// Begins to try every placement, on a thread of its own.
    fn begin(&self, control: &Control) -> JoinHandle<Result<Granted, ReceiverError>> {
        let (runtime, gpu) = (self.runtime.clone(), Arc::clone(&self.gpu));
        let (avatar, control) = (Arc::clone(&self.avatar), control.clone());
        std::thread::spawn(move || {
            let compiled = CompiledSources::default();
            let backends = InferenceBackends {
                runtime: &runtime,
                threads: 1,
                compiled: &compiled,
            };
            let gaussians = u32::try_from(avatar.gaussians.len()).expect("few");
            let options = RendererOptions::new(gaussians, SIDE, SIDE, 1);
            let request = PlacementRequest::default();
            let camera = [camera(SIDE)];
            let placed = place_first(
                &backends, &avatar, &gpu, options, &camera, request, &control,
            );
            let (placed, _) = placed?;
            let tried = placed.report.alternatives.into_iter();
            Ok(tried
                .filter(|one| one.costs.is_some())
                .map(|one| one.plan)
                .collect())
        })
    }
}

#[test]
fn placing_rests_in_every_pause_and_comes_to_the_same_end() {
    let Some(preparations) = Preparations::new() else {
        return;
    };
    let begun = Instant::now();
    let undisturbed = preparations.begin(&Control::default());
    let undisturbed = undisturbed.join().expect("no panic").expect("placed");
    let whole = begun.elapsed();
    let control = Control::default();
    assert!(control.pause(PATIENCE), "nobody is at work");
    let placing = preparations.begin(&control);
    let mut pauses = 0;
    loop {
        assert!(control.pause(PATIENCE), "the GPU comes to rest");
        if placing.is_finished() {
            break;
        }
        pauses += 1;
        if pauses == LONG {
            // Without a rest it would be done by then. After the last step it may end in a pause: nothing is left to do on the GPU.
            sleep(2 * whole);
            assert!(!placing.is_finished(), "nothing goes on in a pause");
        }
        sleep(Duration::from_millis(5));
        control.resume();
        // Some steps further.
        sleep(Duration::from_millis(7));
    }
    println!("{pauses} pauses");
    assert!(pauses > LONG, "interrupted {pauses} times");
    let granted = placing.join().expect("no panic").expect("placed");
    assert_eq!(granted, undisturbed, "as without pauses");
}

#[test]
fn placing_that_is_left_says_so_wherever_it_is() {
    let Some(preparations) = Preparations::new() else {
        return;
    };
    let begun = Instant::now();
    let placing = preparations.begin(&Control::default());
    placing.join().expect("no panic").expect("placed");
    let whole = begun.elapsed();
    let mut left = 0;
    for moment in 0..8_u32 {
        let control = Control::default();
        let placing = preparations.begin(&control);
        sleep(whole * moment / 8);
        // In a pause as well as without.
        let paused = moment % 2 == 0;
        assert!(!paused || control.pause(PATIENCE), "comes to rest");
        control.leave();
        match placing.join().expect("no panic") {
            Err(ReceiverError::Left) => left += 1,
            Ok(_) => assert!(moment > 0, "placed before it was left"),
            Err(error) => panic!("{error}"),
        }
    }
    println!("left {left} times of 8");
    assert!(left > 1, "left {left} times");
}

#[test]
fn a_graph_that_is_not_wanted_any_more_is_not_loaded() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let avatar = Arc::new(avatar());
    let cancel = Cancel::default();
    let unwanted = runtime.cancelled_by(&cancel);
    let open = |runtime| {
        Inference::open(
            runtime,
            &avatar,
            GraphParts::Whole,
            &[CPU],
            &CompiledSources::default(),
        )
    };
    open(&unwanted).expect("wanted still");
    cancel.cancel();
    let refused = open(&unwanted).expect_err("not wanted");
    let why = matches!(refused, ReceiverError::Deform(RuntimeError::Cancelled));
    assert!(why, "{refused:?}");
    open(&runtime).expect("others are as before");
}
