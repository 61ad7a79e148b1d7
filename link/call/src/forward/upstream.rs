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
use link_playout::clock::Exchange;
use link_protocol::data_channel::Message;
use link_protocol::{Announcement, sealed};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep};

/// A sender that says nothing for so long is joined again.
const SILENCE: Duration = Duration::from_millis(800);

/// How often silence and feedback are looked at.
const TICK: Duration = Duration::from_millis(50);

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
}

impl Upstream {
    /// Whether the sender hung up.
    pub(super) async fn run(&mut self, until: Until) -> bool {
        let mut backoff = Backoff::default();
        let mut last_here = Instant::now();
        loop {
            let mut stop = self.stop.clone();
            let joined = tokio::select! {
                joined = self.join() => joined,
                () = is_set(&mut stop) => return false,
            };
            match joined {
                Ok(mut session) => {
                    log::info!("the sender is here (session {:08x})", session.id);
                    backoff.reset();
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
                Err(error) => log::debug!("the sender is not joined yet: {error}"),
            }
            if let Until::Gone(after) = until
                && last_here.elapsed() > after
            {
                return false;
            }
            tokio::select! {
                () = sleep(backoff.next()) => {}
                () = is_set(&mut stop) => return false,
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
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = is_set(&mut self.stop) => {
                    send_bye(&mut session.peer, session.id).await;
                    return Ended::Stopped;
                }
                _ = ticks.tick() => {
                    if session.last_heard.elapsed() > SILENCE {
                        return Ended::Silent;
                    }
                    session.send_feedback(self.clock, &mut out).await;
                }
                event = session.peer.next() => match event {
                    PeerEvent::Message(bytes) => {
                        session.last_heard = Instant::now();
                        match self.take(session, bytes) {
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
                        if let Some(packet) = session.hear(packet) {
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
    fn take(&self, session: &mut Session, bytes: Bytes) -> Result<bool, CallError> {
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
                let exchange = Exchange {
                    sent: pong.asked,
                    arrived: pong.arrived,
                    left: pong.left,
                    returned: self.clock.now(),
                };
                if let Err(error) = session.offset.observe(&exchange) {
                    log::debug!("ignored a pong: {error}");
                }
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
            Arrived::Message(Message::Feedback(_)) | Arrived::Nothing => {}
            Arrived::Message(Message::State(state)) => {
                // Without viewers nobody listens.
                let _ = self.forwarded.send(Forwarded::State(state));
            }
            // Motion, which the viewers' decoders check, or what is sealed for them.
            Arrived::Motion(bytes) => {
                self.counts.messages.fetch_add(1, Relaxed);
                let _ = self.forwarded.send(Forwarded::Motion(bytes));
            }
        }
        Ok(false)
    }
}
