//! The receiver's end of a call: what arrives goes through the jitter buffer and the bridge, and becomes the motion to show now.

mod figures;

pub use figures::{CallFigures, Gap, LatencyFigures, Percentiles};

use crate::{Bridge, BridgeState};
use figures::Log;
use link::{Announcement, CallEvent, Clock, JitterBuffer, LinkError, Micros, Played, Viewer};
use spmm3::{MotionParams, Skeleton};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// Why a call is over.
#[derive(Debug)]
pub enum CallEnd {
    /// The sender said goodbye.
    HungUp,
    /// The sender has come back as somebody else: another avatar has to be fetched.
    AnotherAvatar(Announcement),
    /// It cannot go on.
    Failed(LinkError),
}

/// A call in progress.
#[derive(Debug)]
pub struct Call {
    viewer: Viewer,
    announced: Announcement,
    clock: Clock,
    buffer: JitterBuffer,
    bridge: Bridge,
    log: Log,
    end: Option<CallEnd>,
}

impl Call {
    /// Follows `viewer`, who was told `announced` before, for an avatar of this `skeleton`.
    #[must_use]
    pub fn new(viewer: Viewer, announced: Announcement, skeleton: &Skeleton, clock: Clock) -> Self {
        Self {
            viewer,
            announced,
            clock,
            buffer: JitterBuffer::new(),
            bridge: Bridge::new(skeleton),
            log: Log::new(clock.now()),
            end: None,
        }
    }

    /// What to show now, and where it comes from; `None` until the first frame. The frames that are due are taken at this
    /// moment: call it when the deform stage is ready for the answer.
    pub fn motion(&mut self) -> Option<(MotionParams, BridgeState)> {
        self.drain();
        let now = self.clock.now();
        self.release(now);
        if !self.log.has_begun() {
            return None;
        }
        let (motion, state) = self.bridge.sample(now);
        self.log.shown(state);
        Some((motion, state))
    }

    /// Waits until a frame is due, something else happens, or `longest` has passed, then hands out what is due. For a receiver
    /// that shows nothing.
    pub fn wait(&mut self, longest: Duration) {
        let until = self.clock.now().0.saturating_add(micros(longest));
        loop {
            let now = self.clock.now();
            if self.release(now) || self.is_over() || now.0 >= until {
                return;
            }
            let due = self
                .buffer
                .next()
                .map_or(until, |(_, due)| due.0.min(until));
            let pause = Duration::from_micros(due.saturating_sub(now.0));
            match self.viewer.next(pause) {
                Ok(event) => self.take(event),
                Err(RecvTimeoutError::Timeout) => {}
                // There is nothing more to come, but there may be frames to wait for.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(pause),
            }
        }
    }

    /// Why the call is over, if it is. What came before a goodbye is shown before.
    pub fn end(&mut self) -> Option<CallEnd> {
        if self.is_over() {
            self.end.take()
        } else {
            None
        }
    }

    fn is_over(&self) -> bool {
        match &self.end {
            Some(CallEnd::HungUp) => self.buffer.waiting() == 0,
            end => end.is_some(),
        }
    }

    /// What was measured so far.
    #[must_use]
    pub fn figures(&self) -> CallFigures {
        self.log.figures(
            self.clock.now(),
            &self.announced,
            self.viewer.statistics(),
            self.buffer.statistics(),
        )
    }

    /// Leaves the call.
    pub async fn hang_up(self) {
        self.viewer.hang_up().await;
    }

    fn drain(&mut self) {
        loop {
            match self.viewer.next(Duration::ZERO) {
                Ok(event) => self.take(event),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn take(&mut self, event: CallEvent) {
        match event {
            CallEvent::Announced(announced) => {
                if announced.avatar != self.announced.avatar {
                    self.end = Some(CallEnd::AnotherAvatar(announced));
                }
                self.announced = announced;
            }
            CallEvent::Joined => {
                self.buffer.reset();
            }
            CallEvent::Frame {
                frame,
                captured,
                arrived,
            } => {
                self.buffer.push(frame, arrived, captured);
            }
            CallEvent::HungUp => self.end = Some(CallEnd::HungUp),
            CallEvent::Failed(error) => self.end = Some(CallEnd::Failed(error)),
        }
    }

    /// Gives the bridge all that is due; returns whether there was anything.
    fn release(&mut self, now: Micros) -> bool {
        let mut any = false;
        for Played { frame, timing } in self.buffer.take(now) {
            self.log.released(&timing);
            self.bridge.push(&frame);
            any = true;
        }
        any
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}
