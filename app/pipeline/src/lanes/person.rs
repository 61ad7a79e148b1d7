//! One person as the GPU lane sees them: the lanes that make their Gaussians, what these have given, and where they stand.
//!
//! Nothing here is shared between people but the renderer that is passed in.

use super::costly::{Budget, LeftOut};
use super::cpu::{Interpolated, Request, View};
use super::device::DevicePosing;
use super::threads::Threads;
use super::triple_buffer::{Overwritten, Reader, WakeSignal, Writer, triple_buffer};
use super::{MotionSource, Visibility};
use crate::error::ReceiverError;
use crate::inference::{Fault, ProviderChange, ProviderChanges};
use crate::profile::{Collector, Recorder};
use glam::Affine3A;
use renderer_splat::drawing::{Foreground, Part};
use renderer_splat::renderer::SplatRenderer;
use std::sync::mpsc::Sender;
use std::time::Instant;

/// A person's lanes, and what they have made.
#[derive(Debug)]
pub(super) struct Person<S: MotionSource> {
    pub(super) threads: Threads<S>,
    /// What these lanes record, and the GPU's of this person's pictures.
    pub(super) collector: Collector,
    pub(super) recorder: Recorder,
    pub(super) supply: Supply,
    pub(super) fault: Fault,
    pub(super) changes: ProviderChanges,
    pub(super) counts: Counts,
    /// The Gaussians there are, and whether they were drawn before.
    pub(super) view: Option<View>,
    pub(super) repeated: bool,
    /// What the CPU lane was asked for last.
    pub(super) asked: Option<Request>,
    /// Rigid.
    pub(super) world_from_person: Affine3A,
    pub(super) visibility: Visibility,
    /// Whether their Gaussians cost too much to be drawn.
    pub(super) budget: Budget,
    /// They left, or a lane of theirs ended, while another person stays.
    pub(super) is_gone: bool,
    /// What ended that lane.
    pub(super) error: Option<ReceiverError>,
}

/// What is left of a person whose lanes were stopped.
#[derive(Debug)]
pub struct FinishedPerson<S> {
    /// Where the poses came from; nothing where the lane that took them panicked.
    pub source: Option<S>,
    /// The error that ended a lane.
    pub error: Option<ReceiverError>,
    /// Why pictures were drawn without them, if any were.
    pub left_out: Option<LeftOut>,
    /// What the lanes recorded, and the GPU's of pictures with this person.
    pub collector: Collector,
    /// Providers that were given up, and for what.
    pub provider_changes: Vec<ProviderChange>,
}

/// Where the Gaussians of pictures come from.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there are few, and they stay where they are"
)]
pub(super) enum Supply {
    /// The CPU lane.
    Host {
        requests: Writer<Request>,
        pictures: Reader<Interpolated>,
        renew: Sender<Writer<Interpolated>>,
        bell: WakeSignal,
        /// Gaussians there is room for in a slot.
        room: u32,
    },
    /// The device itself.
    Device(DevicePosing),
}

/// What each hand-over lost.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) poses: Overwritten,
    pub(super) inferences: Overwritten,
    pub(super) requests: Overwritten,
    pub(super) interpolations: Overwritten,
}

impl<S: MotionSource> Person<S> {
    /// What of them is to be seen; nothing before the first Gaussians, while they are hidden, and once they are gone.
    pub(super) fn view(&self) -> Option<&View> {
        self.view.as_ref().filter(|_| self.is_present())
    }

    /// Whether they are to be seen, if there are Gaussians of them: not while these cost too much.
    pub(super) fn is_present(&self) -> bool {
        !self.is_gone && !self.visibility.is_hidden() && !self.budget.is_exceeded()
    }

    /// Is not shown any longer; the lanes end by themselves.
    pub(super) fn leave(&mut self) {
        self.is_gone = true;
        self.threads.ask_to_stop();
    }

    /// Stops the lanes; what is left.
    pub(super) fn finish(mut self) -> FinishedPerson<S> {
        let (source, error) = self.threads.finish();
        self.collector.collect();
        FinishedPerson {
            source,
            error: self.error.or(error),
            left_out: self.budget.report(),
            provider_changes: self.changes.all(),
            collector: self.collector,
        }
    }

    /// Takes the newest Gaussians there are; on the device, those of `picture`.
    ///
    /// # Errors
    /// If the graph's results are not those of the renderer's mesh.
    pub(super) fn take(
        &mut self,
        renderer: &mut SplatRenderer,
        picture: Request,
    ) -> Result<(), ReceiverError> {
        self.collector.collect();
        if self.is_gone {
            return Ok(());
        }
        match &mut self.supply {
            Supply::Host { pictures, .. } => {
                self.repeated = !pictures.take();
                if !self.repeated {
                    self.view.clone_from(&pictures.taken().view);
                }
            }
            Supply::Device(posing) => self.view = posing.view(renderer, picture)?,
        }
        Ok(())
    }

    /// Asks the CPU lane for the Gaussians of `next`, or of `first` where there are none yet: it could not be asked for before.
    pub(super) fn ask(&mut self, first: Request, next: Request) {
        let request = if self.view.is_none() { first } else { next };
        if let (Supply::Host { requests, .. }, false) = (&mut self.supply, self.is_gone) {
            *requests.place() = request;
            requests.give();
            self.asked = Some(request);
        }
    }

    /// The picture took less time than expected, so the next one begins sooner too, at `begins`, and is displayed as much sooner
    /// where it is not known when: without its Gaussians those of this one would be drawn once more, and would be a whole picture
    /// older.
    pub(super) fn reschedule_earlier(&mut self, begins: Instant, displayed: Option<Instant>) {
        let (Supply::Host { requests, .. }, Some(asked)) = (&mut self.supply, self.asked) else {
            return;
        };
        let sooner = asked.wanted.saturating_duration_since(begins);
        if !sooner.is_zero() && !self.is_gone {
            *requests.place() = Request {
                wanted: begins,
                displayed: displayed
                    .or_else(|| asked.displayed.checked_sub(sooner))
                    .unwrap_or(begins),
                ..asked
            };
            requests.give();
        }
    }

    /// What the renderer is to draw of them, if they are there.
    pub(super) fn part(&mut self, level: usize) -> Option<Part<'_>> {
        self.view()?;
        let gaussians = match &mut self.supply {
            Supply::Host { pictures, .. } => Foreground::Slot(&pictures.taken().slot),
            Supply::Device(posing) => posing.foreground(level)?,
        };
        Some(Part {
            gaussians,
            world_from_part: self.world_from_person,
        })
    }

    /// Gaussians that [`Self::part`] has.
    pub(super) fn gaussians(&mut self, renderer: &SplatRenderer, level: usize) -> u32 {
        if self.view().is_none() {
            return 0;
        }
        match &mut self.supply {
            Supply::Host { pictures, .. } => pictures.taken().slot.len(),
            Supply::Device(_) => {
                (renderer.options().mesh.as_ref()).map_or(0, |mesh| mesh.gaussians_at(level))
            }
        }
    }

    /// Gaussians that a renderer's foreground must have room for.
    pub(super) fn room(&self) -> u32 {
        match &self.supply {
            _ if self.is_gone => 0,
            Supply::Host { room, .. } => *room,
            Supply::Device(_) => 0,
        }
    }

    /// Another renderer on the same device goes on.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub(super) fn adopt(&mut self, renderer: &mut SplatRenderer) -> Result<(), ReceiverError> {
        match &mut self.supply {
            // Slots fit every renderer on their device.
            Supply::Host { .. } => Ok(()),
            Supply::Device(posing) => posing.renewed(renderer),
        }
    }

    /// The renderer is on another device now: Gaussians are written there from now on.
    ///
    /// # Errors
    /// If that device has no memory for them, or the graph's results are not those of the renderer's mesh.
    pub(super) fn renew(&mut self, renderer: &mut SplatRenderer) -> Result<(), ReceiverError> {
        self.view = None;
        self.asked = None;
        match &mut self.supply {
            Supply::Host {
                pictures,
                renew,
                bell,
                room,
                ..
            } => {
                let (writer, reader) =
                    triple_buffer(places(renderer, *room)?, &WakeSignal::default());
                *pictures = reader;
                self.counts.interpolations.go_on_with(&writer.overwritten());
                // A lane that has ended is told of by `begin`.
                if renew.send(writer).is_ok() {
                    bell.ring();
                }
            }
            Supply::Device(posing) => posing.renewed(renderer)?,
        }
        Ok(())
    }
}

/// Room for three foregrounds of so many Gaussians on the renderer's device.
pub(super) fn places(
    renderer: &SplatRenderer,
    room: u32,
) -> Result<[Interpolated; 3], ReceiverError> {
    let one = || -> Result<Interpolated, ReceiverError> {
        let slot = renderer.foreground_slot_for(room)?;
        Ok(Interpolated { slot, view: None })
    };
    Ok([one()?, one()?, one()?])
}
