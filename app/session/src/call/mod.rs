//! The receiver's end of a call: what arrives goes through the jitter buffer and motion concealment, and becomes the motion to show now.

mod figures;
mod times;
mod watch;

pub use figures::{CallFigures, Gap, LatencyFigures};
pub use watch::{CallCounts, CallWatch};

use app_pipeline::concealment::{ConcealmentState, MotionConcealment};
use app_pipeline::lanes::{MotionSource, Pose, Visibility};
use app_pipeline::profile::FrameTimes;
use app_pipeline::timeline::DisplayLag;
use figures::Log;
use link_call::{CallError, CallEvent, Viewer};
use link_codec::Micros;
use link_playout::jitter_buffer::{Played, Timing};
use link_playout::{Clock, JitterBuffer};
use link_protocol::Announcement;
use link_voice::VoiceQueue;
use spmm3::Skeleton;
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// Between two tellings of what was counted: it is looked at twice a second.
const TELLING: Duration = Duration::from_millis(100);

/// After a goodbye, what was said before is heard for so long.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Why a call is over.
#[derive(Debug)]
pub enum CallEnd {
    /// The sender said goodbye.
    HungUp,
    /// The sender has come back with another avatar, which has to be fetched.
    AnotherAvatar(Announcement),
    /// It cannot go on.
    Failed(CallError),
}

/// A call in progress.
#[derive(Debug)]
pub struct Call {
    viewer: Viewer,
    announced: Announcement,
    clock: Clock,
    buffer: JitterBuffer,
    concealment: MotionConcealment,
    log: Log,
    watch: CallWatch,
    voice: VoiceQueue,
    /// Of the pictures that show it.
    lag: DisplayLag,
    visibility: Visibility,
    /// When it was last told what was counted.
    told: Micros,
    end: Option<CallEnd>,
    /// When the sender said goodbye.
    hung_up: Micros,
    /// When a pose is to be made up if no frame has come by then.
    made_up: Micros,
    /// Whether the last pose was of a person at ease, which stays as it is.
    resting: bool,
}

impl Call {
    /// Follows `viewer`, who was told `announced` before, for an avatar of this `skeleton`; what is said arrives in `voice`, and waits for the motion.
    /// Whoever has `watch` reads what it counts, and ends it.
    #[must_use]
    pub fn new(
        viewer: Viewer,
        announced: Announcement,
        skeleton: &Skeleton,
        clock: Clock,
        voice: VoiceQueue,
        watch: CallWatch,
    ) -> Self {
        Self {
            viewer,
            announced,
            clock,
            buffer: JitterBuffer::new(),
            concealment: MotionConcealment::new(skeleton),
            log: Log::new(clock.now()),
            watch,
            voice,
            lag: DisplayLag::default(),
            visibility: Visibility::default(),
            told: Micros(0),
            end: None,
            hung_up: Micros(0),
            made_up: Micros(u64::MAX),
            resting: true,
        }
    }

    /// Waits until a frame is due, something else happens, or `longest` has passed, then hands out what is due. For a receiver
    /// that shows nothing; one that does has the call as its [`MotionSource`].
    pub fn wait(&mut self, longest: Duration) {
        let until = self.until(longest);
        loop {
            let now = self.clock.now();
            if self.release(now).is_some() || self.is_over() || now >= until {
                return;
            }
            self.listen(now, until);
        }
    }

    fn until(&self, longest: Duration) -> Micros {
        Micros(self.clock.now().0.saturating_add(micros(longest)))
    }

    /// Listens to the network until something comes, a frame is due, or it is `until`.
    fn listen(&mut self, now: Micros, until: Micros) {
        if now.0.saturating_sub(self.told.0) >= micros(TELLING) {
            self.told = now;
            let received = self.viewer.statistics();
            self.watch.tell(CallCounts {
                payload_bytes: received.payload_bytes,
                frames: received.frames,
                lost: self.buffer.statistics().lost,
            });
            self.watch.tell_waits(received.waits);
        }
        let due = self.buffer.next().map_or(until, |(_, due)| due.min(until));
        let pause = Duration::from_micros(due.0.saturating_sub(now.0));
        match self.viewer.next(pause) {
            Ok(event) => self.take(event),
            Err(RecvTimeoutError::Timeout) => {}
            // There is nothing more to come, but there may be frames to wait for.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(pause),
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

    /// Whether there is no more to come.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let is_over = match &self.end {
            Some(CallEnd::HungUp) => self.buffer.waiting() == 0 && self.is_heard(),
            end => end.is_some() || self.watch.is_left(),
        };
        if self.watch.is_left() {
            self.viewer.leave();
        }
        if is_over {
            self.watch.end();
        }
        is_over
    }

    /// Whether nothing that was said is still to be played, or who should play it does not.
    fn is_heard(&self) -> bool {
        let since = self.clock.now().0.saturating_sub(self.hung_up.0);
        self.voice.is_played() || since > micros(LAST_WORDS)
    }

    /// What was measured so far.
    #[must_use]
    pub fn figures(&self) -> CallFigures {
        self.log.figures(
            self.clock.now(),
            &self.announced,
            self.viewer.statistics(),
            self.buffer.statistics(),
            self.voice.statistics(),
        )
    }

    /// What the call counts, to be read by who shows it while a lane owns the call.
    #[must_use]
    pub fn watch(&self) -> CallWatch {
        self.watch.clone()
    }

    /// What the person says, on its way to who plays it.
    #[must_use]
    pub fn voice(&self) -> VoiceQueue {
        self.voice.clone()
    }

    /// Leaves the call.
    pub async fn hang_up(self) {
        self.viewer.hang_up().await;
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
                let statistics = self.viewer.statistics();
                self.watch.know(statistics.sender, statistics.person);
                self.buffer.reset();
                self.voice.follow(None);
            }
            CallEvent::Frame {
                frame,
                captured,
                arrived,
            } => {
                self.buffer.push(frame, arrived, captured);
                self.keep_together();
            }
            CallEvent::State(state) => {
                self.visibility.hide(state.hidden);
                self.watch.tell_state(state);
            }
            CallEvent::HungUp => {
                self.end = Some(CallEnd::HungUp);
                self.hung_up = self.clock.now();
            }
            CallEvent::Failed(error) => {
                self.watch.fail(&error);
                self.end = Some(CallEnd::Failed(error));
            }
        }
    }

    /// What is seen and what is heard of one moment come together: whichever is ready first waits.
    fn keep_together(&mut self) {
        let lag = self.lag_us();
        let seen = self.buffer.offset_us();
        self.voice.follow(seen.map(|seen| seen.saturating_add(lag)));
        let heard = self.voice.offset_us(self.clock.now());
        self.buffer
            .wait_for(heard.map(|heard| heard.saturating_sub(lag)));
    }

    /// From when a frame is due to when it is seen; nothing where it is not drawn.
    fn lag_us(&self) -> i64 {
        let lag = self.lag.get().unwrap_or_default();
        i64::try_from(lag.as_micros()).unwrap_or(i64::MAX)
    }

    /// Gives concealment all that is due; returns the newest frame's way, if there was any.
    fn release(&mut self, now: Micros) -> Option<Timing> {
        let mut newest = None;
        let (lag, heard) = (self.lag_us(), self.voice.heard_offset_us(now));
        for Played { frame, timing } in self.buffer.take(now) {
            self.log.released(&timing, lag, heard);
            self.concealment.push(&frame);
            newest = Some(timing);
        }
        newest
    }

    /// What to show from `now` on: a frame's pose at its place in time, or one made up for the moment.
    fn pose(&mut self, now: Micros, timing: Option<Timing>) -> Pose {
        let (motion, source) = self.concealment.sample(now);
        self.log.shown(source);
        self.resting = source == ConcealmentState::Resting;
        // A frame may be followed at once; what is made up comes as frames did, once one is late.
        let pause = self.concealment.interval();
        let pause = if timing.is_some() {
            pause * 3 / 2
        } else {
            pause
        };
        self.made_up = Micros(now.0.saturating_add(micros(pause)));
        let at = |time| self.clock.instant(time);
        let times = match timing {
            Some(timing) => FrameTimes {
                captured: timing.captured_local.map(at),
                arrived: at(timing.arrived),
                due: at(timing.due.max(timing.arrived)),
                ..FrameTimes::new(source, at(timing.released))
            },
            None => FrameTimes::new(source, at(now)),
        };
        Pose { motion, times }
    }
}

impl MotionSource for Call {
    /// The frames' poses as they are due, and while there are none what concealment makes up, at the rate that frames came. `None`
    /// until the first frame, and while the person stands at ease.
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let until = self.until(longest);
        loop {
            let now = self.clock.now();
            if let Some(timing) = self.release(now) {
                return Some(self.pose(now, Some(timing)));
            }
            if self.is_over() || now >= until {
                return None;
            }
            let moves = self.log.has_begun() && !self.resting;
            if moves && now >= self.made_up {
                return Some(self.pose(now, None));
            }
            self.listen(
                now,
                if moves {
                    until.min(self.made_up)
                } else {
                    until
                },
            );
        }
    }

    fn is_over(&self) -> bool {
        Self::is_over(self)
    }

    fn display_lag(&self) -> DisplayLag {
        self.lag.clone()
    }

    fn visibility(&self) -> Visibility {
        self.visibility.clone()
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}
