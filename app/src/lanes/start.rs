//! Starting the lanes: all memory is taken here, and every thread begun.

use super::cpu::{CpuLane, Request};
use super::device::DevicePosing;
use super::hand_over::{Bell, hand_over};
use super::npu::{Inferred, NpuLane};
use super::states::{Heads, States};
use super::threads::Threads;
use super::{Counts, LaneOptions, Lanes, MotionSource, Supply, cpu, motion, places};
use crate::hold::{Hold, KEPT_SHARES, Quality};
use crate::kernels::Detail;
use crate::posing::Posing;
use crate::{Collector, Inference, Lane, Plan, ReceiverError, Timeline};
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Instant;
use xr_renderer::{ForegroundPath, SplatRenderer};

impl<S: MotionSource> Lanes<S> {
    /// Starts the lanes of `avatar` on poses from `source`.
    ///
    /// # Errors
    /// If threads, memory on the device or the avatar's networks are not to be had.
    pub fn start(
        avatar: &Arc<Avatar>,
        inference: Inference,
        renderer: SplatRenderer,
        source: S,
        options: &LaneOptions,
    ) -> Result<Self, ReceiverError> {
        let mut collector = Collector::default();
        let [npu_bell, cpu_bell] = [Bell::default(), Bell::default()];
        let none = motion::Posed::none;
        let (posed, posed_taker) = hand_over([none(), none(), none()], &npu_bell);
        let one = || -> Result<Inferred, ReceiverError> {
            Ok(Inferred {
                outputs: inference.outputs()?,
                posed: none(),
                inference: [Instant::now(); 2],
            })
        };
        let (inferred, inferred_taker) = hand_over([one()?, one()?, one()?], &cpu_bell);
        let mut counts = Counts {
            poses: posed.overwritten(),
            inferences: inferred.overwritten(),
            ..Counts::default()
        };
        let fault = inference.fault();
        let changes = inference.changes();
        let mut threads = Threads::new([npu_bell.clone(), cpu_bell.clone()]);
        let supply = if options.plan == Plan::Pc {
            Supply::Device(DevicePosing::new(inferred_taker, options.latency))
        } else {
            let (requests, requests_taker) = hand_over([Request::none(); 3], &cpu_bell);
            let (pictures, pictures_taker) = hand_over(places(&renderer)?, &Bell::default());
            let (renew, renewed) = channel();
            counts.requests = requests.overwritten();
            counts.interpolations = pictures.overwritten();
            let posing = Posing::new(avatar, options.plan)?;
            let cpu = CpuLane {
                states: States::new(posing.gaussians()),
                posing,
                heads: Heads::new(),
                timeline: Timeline::new(options.latency),
                inferred: inferred_taker,
                requests: requests_taker,
                pictures,
                renewed,
                bell: cpu_bell.clone(),
                recorder: collector.recorder(Lane::Cpu),
                path: ForegroundPath::new(),
                making: None,
                due: None,
                lead: cpu::LEAST_LEAD,
                shown: None,
                kept: details(avatar)?,
            };
            threads.spawn_in_pool("cpu lane", move |stop| cpu.run(stop))?;
            Supply::Host {
                requests,
                pictures: pictures_taker,
                renew,
                bell: cpu_bell,
            }
        };
        let npu = NpuLane {
            inference,
            posed: posed_taker,
            inferred,
            bell: npu_bell.clone(),
            recorder: collector.recorder(Lane::Npu),
        };
        let motion_recorder = collector.recorder(Lane::Motion);
        let recorder = collector.recorder(Lane::Gpu);
        let skeleton = avatar.skeleton.clone();
        threads.spawn_motion(move |stop, over| {
            motion::run(source, &skeleton, posed, motion_recorder, stop, over)
        })?;
        threads.spawn("npu lane", move |stop| npu.run(stop))?;
        Ok(Self {
            threads,
            collector,
            recorder,
            renderer,
            supply,
            fault,
            changes,
            counts,
            quality: Quality::of_step(0),
            hold: Hold::new(options.display_period, options.hold),
            displayed: None,
            number: 0,
            view: None,
            repeated: false,
            asked: None,
            drawing: None,
        })
    }
}

/// The levels of detail beyond the first, which has all Gaussians.
fn details(avatar: &Avatar) -> Result<Vec<Detail>, ReceiverError> {
    avatar
        .kept_levels(&KEPT_SHARES[1..])
        .into_iter()
        .map(|level| Detail::new(avatar.gaussians.len(), level.kept, &level.log2_growth))
        .collect()
}
