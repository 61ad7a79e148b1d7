//! Three units at once: a lane for each, which never waits for another.
//!
//! ```text
//! motion   pose, kinematics ──▶ NPU   deform graph ──▶ CPU   states of Gaussians
//!                                                            interpolation at the display's time ──▶ GPU   picture
//! ```
//! Results are handed on through places that were allocated before (`hand_over.rs`): whoever is slower takes the newest and
//! leaves the rest out, and what is left out is counted. The GPU's lane is the thread that calls [`Lanes`], which is the
//! display's; it asks for the next picture's Gaussians before it draws this one's, so that the CPU makes them meanwhile.

mod cpu;
mod device;
mod display;
mod hand_over;
mod motion;
mod npu;
mod shown;
mod start;
mod states;
mod threads;

pub use display::{DisplayClock, Tick};
pub use hand_over::{Bell, Giver, Taker, hand_over};
pub use motion::{MotionSource, Pose};

use crate::hold::{Hold, HoldFigures, HoldMode, Quality};
use crate::{
    Collector, Fault, LatencyMode, Plan, ProviderChange, ProviderChanges, ReceiverError, Recorder,
};
use cpu::{Interpolated, Request, View};
use device::DevicePosing;
use hand_over::Overwritten;
use spmm3::MotionParams;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};
use threads::Threads;
use xr_renderer::{
    Camera, Drawing, Foreground, ForegroundSlot, Gpu, Part, RenderError, SplatRenderer,
};

/// What lanes are started with.
#[derive(Debug)]
pub struct LaneOptions {
    /// How stages are divided among the units.
    pub plan: Plan,
    /// What is done about the time from one motion frame to the next.
    pub latency: LatencyMode,
    /// What is done when the GPU cannot hold the display's rate.
    pub hold: HoldMode,
    /// From one vertical blank of the display to the next.
    pub display_period: Duration,
}

/// What was left out because a newer one had come, by the lane that would have taken it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Skipped {
    /// Poses that the NPU lane never saw.
    pub poses: u64,
    /// Inferences that the CPU lane never made states of.
    pub inferences: u64,
    /// Pictures that the CPU lane was asked for and had no time to interpolate.
    pub requests: u64,
    /// Interpolated Gaussians that the GPU lane never drew.
    pub interpolations: u64,
}

/// What was drawn.
#[derive(Debug)]
pub enum Drawn {
    /// The picture; it is in the renderer.
    Picture,
    /// None: the device was lost, and another has been opened. Show the next picture on that one.
    Renewed(Arc<Gpu>),
}

/// The lanes of a call, and the renderer.
#[derive(Debug)]
pub struct Lanes<S: MotionSource> {
    threads: Threads<S>,
    collector: Collector,
    recorder: Recorder,
    renderer: SplatRenderer,
    supply: Supply,
    fault: Fault,
    changes: ProviderChanges,
    counts: Counts,
    hold: Hold,
    /// What the picture being made is drawn with.
    quality: Quality,
    displayed: Option<Instant>,
    number: u64,
    /// The Gaussians there are, and whether they were drawn before.
    view: Option<View>,
    repeated: bool,
    /// What the CPU lane was asked for last.
    asked: Option<Request>,
    drawing: Option<Progress>,
}

/// Where the Gaussians of pictures come from.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and it stays where it is"
)]
enum Supply {
    /// The CPU lane.
    Host {
        requests: Giver<Request>,
        pictures: Taker<Interpolated>,
        renew: Sender<Giver<Interpolated>>,
        bell: Bell,
    },
    /// The device itself.
    Device(DevicePosing),
}

/// What each hand-over lost.
#[derive(Debug, Default)]
struct Counts {
    poses: Overwritten,
    inferences: Overwritten,
    requests: Overwritten,
    interpolations: Overwritten,
}

/// A picture on its way.
#[derive(Debug, Clone, Copy)]
struct Progress {
    tick: Tick,
    begun: Instant,
    sorted: Instant,
    drawn: Instant,
}

impl<S: MotionSource> Lanes<S> {
    /// Begins the picture of `tick`: takes the newest Gaussians there are, and has those of the next picture made. Returns the
    /// pose that is about to be drawn, or `None` while there is nobody to be seen yet.
    ///
    /// # Errors
    /// What ended a lane that cannot be replaced.
    pub fn begin(&mut self, tick: Tick) -> Result<Option<&MotionParams>, ReceiverError> {
        self.threads.check()?;
        self.collector.collect();
        let begun = Instant::now();
        self.quality = self.hold.quality();
        let level = self.quality.level;
        match &mut self.supply {
            Supply::Host {
                requests, pictures, ..
            } => {
                self.repeated = !pictures.take();
                // The first is asked for itself: nobody could ask for it before.
                let (displayed, wanted) = if self.view.is_none() && self.repeated {
                    (tick.predicted, begun)
                } else {
                    self.number += 1;
                    (tick.next, tick.next_begins)
                };
                let request = Request {
                    number: self.number + 1,
                    displayed,
                    wanted,
                    level,
                };
                *requests.place() = request;
                requests.give();
                self.asked = Some(request);
                if !self.repeated {
                    self.view.clone_from(&pictures.taken().view);
                }
            }
            Supply::Device(posing) => {
                let request = Request {
                    number: self.number + 1,
                    displayed: tick.predicted,
                    wanted: begun,
                    level,
                };
                self.view = posing.view(&mut self.renderer, request)?;
                self.number += u64::from(self.view.is_some());
            }
        }
        self.drawing = Some(Progress {
            tick,
            begun,
            sorted: begun,
            drawn: begun,
        });
        Ok(self.view.as_ref().map(|view| &view.motion))
    }

    /// Draws the picture that was begun, as `cameras` (one, or two for stereo) see it, and waits until it is drawn.
    ///
    /// # Errors
    /// If the renderer fails other than by losing its device, or there is no other device.
    pub fn draw(&mut self, cameras: &[Camera]) -> Result<Drawn, ReceiverError> {
        let foreground = match &mut self.supply {
            Supply::Host { pictures, .. } => Foreground::Slot(&pictures.taken().slot),
            Supply::Device(posing) => posing.foreground(self.quality.level),
        };
        let scale = self.quality.resolution_scale;
        let scaled: [Option<Camera>; 2] =
            std::array::from_fn(|view| cameras.get(view).map(|camera| camera.scaled(scale)));
        let scaled = match scaled {
            [Some(left), Some(right)] => &[left, right][..],
            [Some(only), _] => &[only],
            _ => &[],
        };
        let drawing = Drawing {
            // One camera too many is the renderer's to refuse.
            cameras: if scale < 1.0 { scaled } else { cameras },
            foreground: &[Part::here(foreground)],
            keep_order: !self
                .number
                .is_multiple_of(u64::from(self.quality.sort_every.max(1))),
        };
        match self.renderer.draw_with(&drawing) {
            Ok(()) => {}
            Err(error @ RenderError::DeviceLost(_)) => {
                log::warn!("{error}; going on with the device opened again");
                return self.recover().map(Drawn::Renewed);
            }
            Err(error) => return Err(error.into()),
        }
        self.tell_stages();
        Ok(Drawn::Picture)
    }

    /// The picture took less time than expected, so the next one begins sooner too, at `begins`: without its Gaussians those of
    /// this one would be drawn once more, and would be a whole picture older.
    fn hurry(&mut self, begins: Instant) {
        let (Supply::Host { requests, .. }, Some(asked)) = (&mut self.supply, self.asked) else {
            return;
        };
        let sooner = asked.wanted.saturating_duration_since(begins);
        if !sooner.is_zero() {
            *requests.place() = Request {
                wanted: begins,
                displayed: asked.displayed.checked_sub(sooner).unwrap_or(begins),
                ..asked
            };
            requests.give();
        }
    }

    /// What was done to hold the display's rate so far.
    #[must_use]
    pub fn hold(&self) -> HoldFigures {
        self.hold.figures()
    }

    fn recover(&mut self) -> Result<Arc<Gpu>, ReceiverError> {
        let gpu = self.renderer.recover()?;
        self.view = None;
        self.drawing = None;
        match &mut self.supply {
            Supply::Host {
                pictures,
                renew,
                bell,
                ..
            } => {
                let (giver, taker) = hand_over(places(&self.renderer)?, &Bell::default());
                *pictures = taker;
                self.counts.interpolations.go_on_with(&giver.overwritten());
                // A lane that has ended is told of by `begin`.
                if renew.send(giver).is_ok() {
                    bell.ring();
                }
            }
            Supply::Device(posing) => posing.renewed(&mut self.renderer)?,
        }
        Ok(gpu)
    }

    /// What was left out so far.
    #[must_use]
    pub fn skipped(&self) -> Skipped {
        Skipped {
            poses: self.counts.poses.count(),
            inferences: self.counts.inferences.count(),
            requests: self.counts.requests.count(),
            interpolations: self.counts.interpolations.count(),
        }
    }

    /// Whether the source has no more poses.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.threads.is_over()
    }

    /// What the lanes told of themselves.
    pub fn collector(&mut self) -> &mut Collector {
        self.collector.collect();
        &mut self.collector
    }

    /// The renderer, which holds the last picture.
    pub fn renderer(&mut self) -> &mut SplatRenderer {
        &mut self.renderer
    }

    /// Goes on with another renderer on the same device, for pictures of another kind.
    ///
    /// # Errors
    /// If it cannot take the Gaussians there are.
    pub fn replace_renderer(&mut self, renderer: SplatRenderer) -> Result<(), ReceiverError> {
        self.renderer = renderer;
        if let Supply::Device(posing) = &mut self.supply {
            posing.renewed(&mut self.renderer)?;
        }
        Ok(())
    }

    /// Providers that were given up so far, and for what.
    #[must_use]
    pub fn provider_changes(&self) -> Vec<ProviderChange> {
        self.changes.all()
    }

    /// A way to make inference fail.
    #[must_use]
    pub fn fault(&self) -> Fault {
        self.fault.clone()
    }

    /// Stops the lanes and gives back where the poses came from, and what was recorded.
    ///
    /// # Errors
    /// What ended a lane before.
    pub fn finish(mut self) -> Result<(S, Collector), ReceiverError> {
        let source = self.threads.finish()?;
        self.collector.collect();
        Ok((source, self.collector))
    }
}

/// Room for three foregrounds on the renderer's device.
fn places(renderer: &SplatRenderer) -> Result<[Interpolated; 3], ReceiverError> {
    let one = || -> Result<Interpolated, ReceiverError> {
        let slot: ForegroundSlot = renderer.foreground_slot()?;
        Ok(Interpolated { slot, view: None })
    };
    Ok([one()?, one()?, one()?])
}
