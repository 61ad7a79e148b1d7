//! Starting the lanes: all memory is taken here, and every thread begun.

use super::costly::{Budget, SlowPictures};
use super::cpu::{CpuLane, Request};
use super::device::{DeviceInput, DevicePosing};
use super::npu::{Inferred, NpuLane};
use super::people::{People, check_room};
use super::person::{Counts, Person, Supply, places};
use super::scenery::Scenery;
use super::states::{Heads, States};
use super::threads::Threads;
use super::triple_buffer::{Reader, WakeSignal, triple_buffer};
use super::{LaneOptions, Lanes, MotionSource, cpu, motion};
use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::plan::Plan;
use crate::posing::Posing;
use crate::profile::Collector;
use crate::quality::{KEPT_SHARES, QualityController};
use crate::stage::Lane;
use crate::timeline::{DisplayLag, LatencyMode, Timeline};
use app_kernels::Detail;
use glam::Affine3A;
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::renderer::SplatRenderer;
use spmm3::Avatar;
use std::sync::Arc;
use std::sync::mpsc::channel;

impl<S: MotionSource> Lanes<S> {
    /// Starts the lanes of `avatar`, the first person, on poses from `source`; `inference` runs what the plan leaves to it.
    ///
    /// # Errors
    /// [`ReceiverError::NoProvider`] if a plan that leaves a graph comes without.
    /// If threads, memory on the device or the avatar's networks are not to be had, or the renderer was made for fewer Gaussians.
    pub fn start(
        avatar: &Arc<Avatar>,
        inference: Option<Inference>,
        renderer: SplatRenderer,
        source: S,
        options: &LaneOptions,
    ) -> Result<Self, ReceiverError> {
        let LaneOptions { plan, latency, .. } = *options;
        let controller = QualityController::new(options.display_period, options.quality)
            .expecting(options.expected_picture);
        let scenery = Scenery::new(&renderer)?;
        let first = Person::start(avatar, inference, &renderer, source, plan, latency)?;
        check_room(&renderer, first.room())?;
        Ok(Self {
            people: People::new(first),
            latency,
            renderer,
            is_lost: false,
            scenery,
            quality: controller.quality(),
            controller,
            slow: SlowPictures::default(),
            displayed: None,
            number: 0,
            drawing: None,
        })
    }
}

impl<S: MotionSource> Person<S> {
    /// Starts the lanes of one person.
    ///
    /// # Errors
    /// As [`Lanes::start`].
    pub(super) fn start(
        avatar: &Arc<Avatar>,
        inference: Option<Inference>,
        renderer: &SplatRenderer,
        source: S,
        plan: Plan,
        latency: LatencyMode,
    ) -> Result<Self, ReceiverError> {
        let visibility = source.visibility();
        let lag = source.display_lag();
        let mut collector = Collector::default();
        let [npu_bell, cpu_bell] = [WakeSignal::default(), WakeSignal::default()];
        let none = motion::Posed::none;
        let (posed, posed_reader) = triple_buffer([none(), none(), none()], &npu_bell);
        let mut counts = Counts {
            poses: posed.overwritten(),
            ..Counts::default()
        };
        let (fault, changes) = (inference.as_ref())
            .map(|inference| (inference.fault(), inference.changes()))
            .unwrap_or_default();
        let mut threads = Threads::new([npu_bell.clone(), cpu_bell.clone()]);
        let supply = match (plan.graph(), inference) {
            (None, None) => {
                let input = DeviceInput::posed(posed_reader, avatar);
                Supply::Device(DevicePosing::new(input, latency, lag))
            }
            (Some(_), None) | (None, Some(_)) => return Err(ReceiverError::NoProvider),
            (Some(_), Some(inference)) => {
                let one = || -> Result<Inferred, ReceiverError> {
                    Ok(Inferred {
                        outputs: inference.outputs()?,
                        posed: none(),
                    })
                };
                let (inferred, inferred_reader) =
                    triple_buffer([one()?, one()?, one()?], &cpu_bell);
                counts.inferences = inferred.overwritten();
                let npu = NpuLane {
                    inference,
                    posed: posed_reader,
                    inferred,
                    bell: npu_bell.clone(),
                    recorder: collector.recorder(Lane::Npu),
                };
                threads.spawn("npu lane", move |stop| npu.run(stop))?;
                if plan.poses_on_device() {
                    let input = DeviceInput::Inferred(inferred_reader);
                    Supply::Device(DevicePosing::new(input, latency, lag))
                } else {
                    let lane = (&mut collector, &mut counts, &mut threads);
                    host_supply(
                        avatar,
                        renderer,
                        plan,
                        (latency, lag),
                        inferred_reader,
                        cpu_bell,
                        lane,
                    )?
                }
            }
        };
        let motion_recorder = collector.recorder(Lane::Motion);
        let skeleton = avatar.skeleton.clone();
        threads.spawn_motion(move |stop, over| {
            motion::run(source, &skeleton, posed, motion_recorder, stop, over)
        })?;
        Ok(Self {
            threads,
            recorder: collector.recorder(Lane::Gpu),
            collector,
            supply,
            fault,
            changes,
            counts,
            view: None,
            repeated: false,
            asked: None,
            world_from_person: Affine3A::IDENTITY,
            visibility,
            budget: Budget::default(),
            is_gone: false,
            error: None,
        })
    }
}

/// A CPU lane that makes a person's Gaussians of what comes in `inferred`.
fn host_supply<S: MotionSource>(
    avatar: &Avatar,
    renderer: &SplatRenderer,
    plan: Plan,
    (latency, lag): (LatencyMode, DisplayLag),
    inferred: Reader<Inferred>,
    bell: WakeSignal,
    (collector, counts, threads): (&mut Collector, &mut Counts, &mut Threads<S>),
) -> Result<Supply, ReceiverError> {
    let (requests, requests_reader) = triple_buffer([Request::none(); 3], &bell);
    let posing = Posing::new(avatar, plan)?;
    let room = u32::try_from(posing.gaussians()).unwrap_or(u32::MAX);
    let (pictures, pictures_reader) =
        triple_buffer(places(renderer, room)?, &WakeSignal::default());
    let (renew, renewed) = channel();
    counts.requests = requests.overwritten();
    counts.interpolations = pictures.overwritten();
    let cpu = CpuLane {
        states: States::new(posing.gaussians()),
        posing,
        heads: Heads::new(),
        timeline: Timeline::new(latency, lag),
        inferred,
        requests: requests_reader,
        pictures,
        renewed,
        bell: bell.clone(),
        recorder: collector.recorder(Lane::Cpu),
        path: MotionBound::new(),
        making: None,
        due: None,
        lead: cpu::LEAST_LEAD,
        shown: None,
        kept: details(avatar)?,
    };
    threads.spawn_in_pool("cpu lane", move |stop| cpu.run(stop))?;
    Ok(Supply::Host {
        requests,
        pictures: pictures_reader,
        renew,
        bell,
        room,
    })
}

/// The levels of detail beyond the first, which has all Gaussians.
fn details(avatar: &Avatar) -> Result<Vec<Detail>, ReceiverError> {
    avatar
        .kept_levels(&KEPT_SHARES[1..])
        .into_iter()
        .map(|level| {
            let all = avatar.gaussians.len();
            Ok(Detail::new(all, level.kept, &level.log2_growth)?)
        })
        .collect()
}
