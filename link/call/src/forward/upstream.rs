//! The forwarder's side towards the sender: a viewer that decodes nothing.

use super::{Counts, Forwarded, OPEN_WITHIN, Source, UNKNOWN};
use crate::introduction::Authentication;
use crate::peer::PeerEvent;
use crate::plan::Planner;
use crate::session::{Arrived, Session};
use crate::signaling::Signaling;
use crate::{Backoff, CallError, answer_bye, is_set, send_bye};
use bytes::Bytes;
use identity::PublicKey;
use link_playout::Clock;
use link_protocol::data_channel::Message;
use link_protocol::sealed::Header;
use link_protocol::{Announcement, sealed};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout_at};

/// A sender that says nothing for so long is joined again.
const SILENCE: Duration = Duration::from_millis(800);

/// How often silence and feedback are looked at.
const TICK: Duration = Duration::from_millis(50);

/// How often the sender is told how many watch: a message may be lost.
const TELL_EVERY: Duration = Duration::from_secs(1);

/// Why the connection to the sender has ended.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error("it hung up")]
    HungUp,
    #[error("it was silent")]
    Silent,
    #[error("it is closed")]
    Closed,
    #[error(transparent)]
    Refused(CallError),
    #[error("this side has ended")]
    Stopped,
}

/// When to give up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Until {
    /// When this side is stopped: the sender may come and go.
    Stopped,
    /// When the sender hangs up, or is away for so long.
    Gone(Duration),
}

impl Until {
    /// Whether that is now, for a sender that was there last then.
    fn is_over(self, last_here: Instant) -> bool {
        matches!(self, Self::Gone(after) if last_here.elapsed() >= after)
    }
}

/// What a sender may have handed on in a second, bytes of each frame a second and of voice: twice what it needs at most, for it is sent so many times.
const BYTES_A_FRAME: f64 = 1_000.0;
const BYTES_OF_VOICE: f64 = 25_000.0;

/// So many bytes a second, those of a second at once.
struct Budget {
    a_second: f64,
    left: f64,
    at: Instant,
}

impl Budget {
    fn of(announced: &Announcement) -> Self {
        let a_second = 2.0 * (announced.rate_hz * BYTES_A_FRAME + BYTES_OF_VOICE);
        Self {
            a_second,
            left: a_second,
            at: Instant::now(),
        }
    }

    /// Whether so many more are within it.
    fn allows(&mut self, bytes: usize) -> bool {
        let now = Instant::now();
        let since = now.duration_since(self.at).as_secs_f64();
        self.at = now;
        self.left = (self.left + since * self.a_second).min(self.a_second);
        let fits = self.left >= bytes as f64;
        if fits {
            self.left -= bytes as f64;
        }
        fits
    }
}

/// The side towards the sender.
pub(super) struct Upstream {
    pub(super) signaling: Arc<dyn Signaling>,
    pub(super) planner: Planner,
    pub(super) clock: Clock,
    pub(super) announcing: watch::Sender<Announcement>,
    pub(super) telling: watch::Sender<Option<Source>>,
    /// Who the sender is.
    pub(super) meeting: watch::Sender<Option<PublicKey>>,
    pub(super) forwarded: broadcast::Sender<Forwarded>,
    pub(super) counts: Arc<Counts>,
    pub(super) stop: watch::Receiver<bool>,
    /// Nothing is handed on but what is sealed: what this side could make of the rest, it could also change.
    pub(super) only_sealed: bool,
}

impl Upstream {
    /// Whether the sender hung up.
    pub(super) async fn run(&mut self, until: Until) -> bool {
        let mut backoff = Backoff::default();
        let mut last_here = Instant::now();
        let mut is_told = false;
        loop {
            let mut stop = self.stop.clone();
            let joined = tokio::select! {
                joined = self.join_within(until, last_here) => joined,
                () = is_set(&mut stop) => return false,
            };
            match joined {
                Ok(mut session) => {
                    log::info!("the sender is here (session {:08x})", session.id);
                    backoff.reset();
                    is_told = false;
                    // The sender before may have had another clock.
                    self.counts.offset_us.store(UNKNOWN, Relaxed);
                    self.telling.send_replace(Some(Source::of(session.id)));
                    // Once it has ended the audience is told the same further on: that is the sign of life for which it stays.
                    let why = self.pump(&mut session).await;
                    session.peer.close().await;
                    log::info!("the connection to the sender has ended: {why}");
                    if matches!(why, Ended::HungUp) && until != Until::Stopped {
                        return true;
                    }
                    last_here = Instant::now();
                }
                // It does not take a forwarder, or no further one.
                Err(error @ (CallError::TooManyViewers | CallError::Refused(_)))
                    if until != Until::Stopped =>
                {
                    log::warn!("a sender is not forwarded: {error}");
                    return false;
                }
                // The other side is not who it should be. The next answer may be the sender's again.
                Err(error) if error.is_final() && !std::mem::replace(&mut is_told, true) => {
                    log::warn!("a sender is not forwarded: {error}");
                }
                Err(error) => log::debug!("the sender is not joined yet: {error}"),
            }
            if until.is_over(last_here) {
                return false;
            }
            tokio::select! {
                () = sleep(backoff.next()) => {}
                () = is_set(&mut stop) => return false,
            }
        }
    }

    async fn join_within(&self, until: Until, last_here: Instant) -> Result<Session, CallError> {
        match until {
            Until::Stopped => self.join().await,
            Until::Gone(after) => {
                let joined = timeout_at(last_here + after, self.join()).await;
                joined.map_err(|_| CallError::NotConnected)?
            }
        }
    }

    async fn join(&self) -> Result<Session, CallError> {
        let status = self.signaling.status().await?;
        self.announcing.send_if_modified(|announced| {
            std::mem::replace(announced, status.announcement) != status.announcement
        });
        let server = self.signaling.room().server();
        let plan = self.planner.plan(server, &status.ice_servers).await;
        let announcement = &status.announcement;
        Session::open(
            &*self.signaling,
            announcement,
            plan,
            &Authentication::default(),
            self.clock,
            OPEN_WITHIN,
        )
        .await
    }

    /// Hands on what comes until the connection ends; why it did.
    async fn pump(&mut self, session: &mut Session) -> Ended {
        let mut out = Vec::with_capacity(64);
        let mut budget = Budget::of(&self.announcing.borrow());
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut tells = interval(TELL_EVERY);
        tells.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                // A sender believes this of its server's forwarder alone.
                _ = tells.tick(), if self.only_sealed => {
                    let viewers = self.counts.viewers.load(Relaxed);
                    let viewers = u32::try_from(viewers).unwrap_or(u32::MAX);
                    Message::Watching { viewers }.write(session.id, &mut out);
                    session.peer.try_send(&out).await;
                }
                () = is_set(&mut self.stop) => {
                    send_bye(&mut session.peer, session.id).await;
                    return Ended::Stopped;
                }
                _ = ticks.tick() => {
                    if session.last_heard.elapsed() > SILENCE || session.cannot_open() {
                        return Ended::Silent;
                    }
                    session.send_feedback(self.clock, &mut out).await;
                }
                event = session.peer.next() => match event {
                    PeerEvent::Message(bytes) => {
                        session.last_heard = Instant::now();
                        match self.take(session, bytes, &mut budget) {
                            Ok(false) => {}
                            Ok(true) => {
                                answer_bye(&session.peer, session.id).await;
                                return Ended::HungUp;
                            }
                            Err(error) => return Ended::Refused(error),
                        }
                    }
                    PeerEvent::Voice(packet) => {
                        self.counts.voice.fetch_add(1, Relaxed);
                        if let Some(packet) = session.hear(packet)
                            && budget.allows(packet.opus.len())
                        {
                            // Without viewers nobody listens.
                            let _ = self.forwarded.send(Forwarded::Voice(packet));
                        }
                    }
                    PeerEvent::Open => {}
                    PeerEvent::Closed => return Ended::Closed,
                }
            }
        }
    }

    /// Takes one message of the sender's; whether it was a bye.
    fn take(
        &self,
        session: &mut Session,
        bytes: Bytes,
        budget: &mut Budget,
    ) -> Result<bool, CallError> {
        if !session.is_sealed()
            && let Some(lines) = sealed::read_seal(&bytes, session.id)
        {
            self.telling.send_if_modified(|told| match told {
                Some(source) => source.seal_with(lines),
                None => false,
            });
            return Ok(false);
        }
        let arrived = session.read(bytes)?;
        self.meeting
            .send_if_modified(|met| std::mem::replace(met, session.sender) != session.sender);
        match arrived {
            Arrived::Message(Message::Bye) => return Ok(true),
            Arrived::Message(Message::Pong(pong)) => {
                session.compare_clocks(pong, self.clock);
                let offset = session.offset.offset_us().unwrap_or(UNKNOWN);
                self.counts.offset_us.store(offset, Relaxed);
            }
            // The sender is a forwarder itself.
            Arrived::Message(Message::Forwarded { of }) => {
                session.follow(of);
                self.telling.send_if_modified(|told| {
                    let is_new = told.as_ref().is_none_or(|told| told.session != of);
                    if is_new {
                        *told = Some(Source::of(of));
                    }
                    is_new
                });
            }
            Arrived::Message(Message::Feedback(_) | Message::Watching { .. })
            | Arrived::Unsealed
            | Arrived::Nothing => {}
            Arrived::Message(Message::State(_)) if self.only_sealed => {}
            Arrived::Message(Message::State(state)) => {
                // Without viewers nobody listens.
                let _ = self.forwarded.send(Forwarded::State(state));
            }
            // Motion, which the viewers' decoders check, or what is sealed for them.
            Arrived::Motion(bytes)
                if (self.only_sealed && Header::read(&bytes).is_none())
                    || !budget.allows(bytes.len()) => {}
            Arrived::Motion(bytes) => {
                self.counts.messages.fetch_add(1, Relaxed);
                let _ = self.forwarded.send(Forwarded::Motion(bytes));
            }
        }
        Ok(false)
    }
}
