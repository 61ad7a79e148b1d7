//! The CPU lane: states of Gaussians from what the graph made, and pictures between them, packed for the renderer.
//!
//! A picture that is asked for comes first: a state is made in slices, between which the lane looks whether one is.

use super::npu::Inferred;
use super::states::{Between, Heads, StateHead, States};
use super::triple_buffer::{Reader, WakeSignal, Writer};
use crate::concealment::between;
use crate::error::ReceiverError;
use crate::posing::Posing;
use crate::profile::{FrameTimes, Recorder};
use crate::stage::Stage;
use crate::timeline::Timeline;
use app_kernels::state::StateChange;
use app_kernels::{Blend, Detail};
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::slot::ForegroundSlot;
use spmm3::MotionParams;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// How long the lane sleeps at most before it looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(100);
/// Gaussians of a state that are made without a look at what else is to be done: half a millisecond's worth.
const SLICE: usize = 8192;

/// Seconds before Gaussians are wanted that their making begins at the latest: a slice of a state may be under way, and a busy
/// machine does not wake a thread at once.
pub(super) const LEAST_LEAD: f64 = 0.0015;
const MOST_LEAD: f64 = 0.05;
/// Share of what the lead is too long by that it loses with every picture.
const LEARNING: f64 = 0.01;

/// A picture that the GPU lane will want.
#[derive(Debug, Clone, Copy)]
pub(super) struct Request {
    pub(super) number: u64,
    /// When it is to be displayed.
    pub(super) displayed: Instant,
    /// When the GPU lane will want its Gaussians: the later they are made, the newer the motion they show.
    pub(super) wanted: Instant,
    /// How much of the person is drawn: 0 is all.
    pub(super) level: usize,
}

/// Gaussians at one moment, where the renderer reads them.
#[derive(Debug)]
pub(super) struct Interpolated {
    pub(super) slot: ForegroundSlot,
    pub(super) view: Option<View>,
}

/// What a picture shows.
#[derive(Debug, Clone)]
pub(super) struct View {
    /// The picture that it was made for.
    pub(super) number: u64,
    pub(super) states: [FrameTimes; 2],
    pub(super) alpha: f32,
    /// The pose, interpolated as the Gaussians are.
    pub(super) motion: MotionParams,
    pub(super) interpolation: [Instant; 2],
    /// How much of the person there is.
    pub(super) level: usize,
}

/// The lane's thread.
#[derive(Debug)]
pub(super) struct CpuLane {
    pub(super) posing: Posing,
    pub(super) states: States,
    pub(super) heads: Heads,
    pub(super) timeline: Timeline,
    pub(super) inferred: Reader<Inferred>,
    pub(super) requests: Reader<Request>,
    pub(super) pictures: Writer<Interpolated>,
    /// Places on another device, after the first was lost.
    pub(super) renewed: Receiver<Writer<Interpolated>>,
    pub(super) bell: WakeSignal,
    pub(super) recorder: Recorder,
    pub(super) path: MotionBound,
    pub(super) making: Option<Making>,
    /// The picture that is to be made next.
    pub(super) due: Option<Request>,
    /// Seconds before Gaussians are wanted that their making begins.
    pub(super) lead: f64,
    /// Where the last picture lay, and at which level of detail.
    pub(super) shown: Option<(Between, usize)>,
    /// The Gaussians of each level but the first, which has all.
    pub(super) kept: Vec<Detail>,
}

/// A state that is being made.
#[derive(Debug, Clone)]
pub(super) struct Making {
    place: usize,
    done: usize,
    change: StateChange,
}

impl CpuLane {
    /// Until `stop`.
    ///
    /// # Errors
    /// If the graph's outputs are not those of the plan, or the renderer's slots too small for the avatar.
    pub(super) fn run(mut self, stop: &AtomicBool) -> Result<(), ReceiverError> {
        while !stop.load(Relaxed) {
            if let Ok(renewed) = self.renewed.try_recv() {
                self.pictures = renewed;
            }
            if self.requests.take() {
                self.due = Some(*self.requests.taken());
            }
            let margin = Duration::from_secs_f64(self.lead);
            let early = self
                .due
                .map(|request| (request.wanted).saturating_duration_since(Instant::now() + margin));
            if early.is_some_and(|early| early.is_zero()) {
                self.interpolate()?;
            } else if let Some(making) = self.making.take() {
                self.make_a_slice(making)?;
            } else if self.inferred.take() {
                self.begin_a_state()?;
            } else {
                self.bell.wait(early.unwrap_or(PATIENCE));
            }
        }
        Ok(())
    }

    /// Takes what the graph gave, and skins where that is left to the CPU.
    fn begin_a_state(&mut self) -> Result<(), ReceiverError> {
        let began = Instant::now();
        let inferred = self.inferred.taken();
        let posed = &inferred.posed;
        if self.posing.skin(&inferred.outputs, &posed.skinning)? {
            self.recorder
                .span_until_now(Stage::Skin, posed.pose.times.number, began);
        }
        let place = self.heads.next_place();
        self.heads.make_room();
        self.making = Some(Making {
            place,
            done: 0,
            change: StateChange::default(),
        });
        Ok(())
    }

    fn make_a_slice(&mut self, mut making: Making) -> Result<(), ReceiverError> {
        let begun = Instant::now();
        let inferred = self.inferred.taken();
        let posed = &inferred.posed;
        let count = self.posing.gaussians();
        let range = making.done..(making.done + SLICE).min(count);
        making.done = range.end;
        let newest = self.heads.newest_place();
        let (state, previous) = self.states.writing(making.place, newest);
        let (outputs, motion) = (&inferred.outputs, &posed.pose.motion);
        let change = (self.posing).pose(outputs, motion, range, previous, state)?;
        making.change = making.change.join(change);
        let ended = self
            .recorder
            .span_until_now(Stage::Bind, posed.pose.times.number, begun);
        if making.done < count {
            self.making = Some(making);
            return Ok(());
        }
        let mut head = StateHead::new(&posed.pose);
        head.times.ready = ended;
        head.moved(making.change);
        self.heads.push(head, making.place, &mut self.timeline);
        Ok(())
    }

    fn interpolate(&mut self) -> Result<(), ReceiverError> {
        let Some(request) = self.due.take() else {
            return Ok(());
        };
        let begun = Instant::now();
        let Some(newest) = self.heads.newest_due() else {
            return Ok(());
        };
        let moment = self.timeline.moment(request.displayed, newest);
        let Some(now) = self.heads.around(moment, &self.timeline) else {
            return Ok(());
        };
        let [Some(from), Some(to)] = now.places.map(|place| self.heads.at(place)) else {
            return Ok(());
        };
        let place = self.pictures.place();
        let [older, newer] = self.states.reading(now.places);
        let blend = Blend::new(older, newer, now.alpha)?;
        let gaussians = place.slot.gaussians_mut();
        let count = match request
            .level
            .checked_sub(1)
            .and_then(|at| self.kept.get(at))
        {
            Some(detail) => {
                let out = gaussians.get_mut(..detail.len()).unwrap_or_default();
                blend.pack_kept(detail, out)?;
                detail.len()
            }
            None => {
                let out = gaussians.get_mut(..older.len()).unwrap_or_default();
                blend.pack(0..older.len(), out)?;
                older.len()
            }
        };
        let way = self
            .shown
            .filter(|(_, level)| *level == request.level)
            .and_then(|(before, _)| self.heads.way(before, now));
        match way {
            Some(way) => self.path.advance(way),
            // Other Gaussians, or a change that is not known.
            None => self.path = MotionBound::new(),
        }
        self.shown = Some((now, request.level));
        let ended = self
            .recorder
            .span_until_now(Stage::Interpolate, request.number, begun);
        // Too late counts at once, too early little by little.
        let late = ended
            .saturating_duration_since(request.wanted)
            .as_secs_f64();
        let least = LEAST_LEAD + 2.0 * (ended - begun).as_secs_f64();
        let lead = self.lead + late - (self.lead - least) * LEARNING;
        self.lead = lead.clamp(LEAST_LEAD, MOST_LEAD);
        place.view = Some(View {
            number: request.number,
            states: [from.times, to.times],
            alpha: now.alpha,
            motion: between(&from.motion, &to.motion, now.alpha),
            interpolation: [begun, ended],
            level: request.level,
        });
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        place.slot.set(count, self.path)?;
        self.pictures.give();
        Ok(())
    }
}

impl Request {
    /// Before the first.
    pub(super) fn none() -> Self {
        Self {
            number: 0,
            displayed: Instant::now(),
            wanted: Instant::now(),
            level: 0,
        }
    }
}
