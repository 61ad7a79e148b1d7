//! The forwarder's side towards the sender: a viewer that decodes nothing.

use super::{Counts, Forwarded, OPEN_WITHIN, UNKNOWN};
use crate::introduction::Authentication;
use crate::peer::PeerEvent;
use crate::plan::Planner;
use crate::session::Session;
use crate::{Backoff, CallError, answer_bye, is_set, send_bye};
use bytes::Bytes;
use identity::PublicKey;
use link_http::Client;
use link_playout::Clock;
use link_playout::clock::Exchange;
use link_protocol::data_channel::Message;
use link_protocol::{Announcement, RoomLink};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep};

/// A sender that says nothing for so long is joined again.
const SILENCE: Duration = Duration::from_millis(800);

/// How often silence and feedback are looked at.
const TICK: Duration = Duration::from_millis(50);

/// The side towards the sender.
pub(super) struct Upstream {
    pub(super) client: Client,
    pub(super) planner: Planner,
    pub(super) source: RoomLink,
    pub(super) clock: Clock,
    pub(super) announcing: watch::Sender<Announcement>,
    pub(super) telling: watch::Sender<Option<u32>>,
    /// Who the sender is.
    pub(super) meeting: watch::Sender<Option<PublicKey>>,
    pub(super) forwarded: broadcast::Sender<Forwarded>,
    pub(super) counts: Arc<Counts>,
    pub(super) stop: watch::Receiver<bool>,
}

impl Upstream {
    pub(super) async fn run(mut self) {
        let mut backoff = Backoff::default();
        loop {
            let mut stop = self.stop.clone();
            let joined = tokio::select! {
                joined = self.join() => joined,
                () = is_set(&mut stop) => return,
            };
            match joined {
                Ok(mut session) => {
                    log::info!("the sender is here (session {:08x})", session.id);
                    backoff.reset();
                    self.meeting.send_replace(session.sender);
                    self.telling.send_replace(Some(session.id));
                    // Once it has ended the audience is told the same further on: that is the sign of life for which it stays.
                    let why = self.pump(&mut session).await;
                    session.peer.close().await;
                    log::info!("the connection to the sender has ended: {why}");
                }
                Err(error) => log::debug!("the sender is not joined yet: {error}"),
            }
            tokio::select! {
                () = sleep(backoff.next()) => {}
                () = is_set(&mut stop) => return,
            }
        }
    }

    async fn join(&self) -> Result<Session, CallError> {
        let status = self.client.room_status(&self.source).await?;
        let status = status.ok_or(CallError::SenderAbsent)?;
        self.announcing.send_if_modified(|announced| {
            std::mem::replace(announced, status.announcement) != status.announcement
        });
        let server = self.source.server();
        let plan = self.planner.plan(server, &status.ice_servers).await;
        let announcement = &status.announcement;
        Session::open(
            &self.client,
            &self.source,
            announcement,
            plan,
            &Authentication::default(),
            self.clock,
            OPEN_WITHIN,
        )
        .await
    }

    /// Hands on what comes until the connection ends; why it did.
    async fn pump(&mut self, session: &mut Session) -> &'static str {
        let mut out = Vec::with_capacity(64);
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = is_set(&mut self.stop) => {
                    send_bye(&mut session.peer, session.id).await;
                    return "this side has ended";
                }
                _ = ticks.tick() => {
                    if session.last_heard.elapsed() > SILENCE {
                        return "it was silent";
                    }
                    session.send_feedback(self.clock, &mut out).await;
                }
                event = session.peer.next() => match event {
                    PeerEvent::Message(bytes) => {
                        session.last_heard = Instant::now();
                        if self.take(session, bytes) {
                            answer_bye(&session.peer, session.id).await;
                            return "it hung up";
                        }
                    }
                    PeerEvent::Voice(packet) => {
                        self.counts.voice.fetch_add(1, Relaxed);
                        // Without viewers nobody listens.
                        let _ = self.forwarded.send(Forwarded::Voice(packet));
                    }
                    PeerEvent::Open => {}
                    PeerEvent::Closed => return "it is closed",
                }
            }
        }
    }

    /// Takes one message of the sender's; whether it was a bye.
    fn take(&self, session: &mut Session, bytes: Bytes) -> bool {
        match Message::read(&bytes, session.id) {
            Some(Message::Bye) => return true,
            Some(Message::Pong(pong)) => {
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
            Some(Message::Forwarded { of }) => {
                self.telling
                    .send_if_modified(|told| told.replace(of) != Some(of));
            }
            Some(Message::Feedback(_)) => log::debug!("ignored a feedback from the sender"),
            Some(Message::State(state)) => {
                // Without viewers nobody listens.
                let _ = self.forwarded.send(Forwarded::State(state));
            }
            // Motion, which the viewers' decoders check.
            None => {
                self.counts.messages.fetch_add(1, Relaxed);
                let _ = self.forwarded.send(Forwarded::Motion(bytes));
            }
        }
        false
    }
}
