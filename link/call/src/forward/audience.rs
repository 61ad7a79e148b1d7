//! The forwarder's side towards the audience: a task for each viewer.

use super::{Counts, Forwarded, OPEN_WITHIN, Source, UNKNOWN};
use crate::peer::{Peer, PeerEvent, SendOutcome};
use crate::plan::Planner;
use crate::sdp::Description;
use crate::telling::Repeated;
use crate::voice_track::VoicePacket;
use crate::{CallError, answer_bye, is_set, send_bye};
use link_codec::Micros;
use link_playout::Clock;
use link_protocol::data_channel::{Message, Pong};
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, IceServers, sealed};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, sleep_until, timeout};

/// A viewer that says nothing for so long is gone.
const VIEWER_SILENCE: Duration = Duration::from_secs(4);

/// A seal's lines are told with each so many of the other messages about the source: they are long.
const SEALS_APART: u32 = 5;

/// What the tasks of the viewers share.
#[derive(Clone)]
pub(super) struct Stage {
    pub(super) planner: Planner,
    /// Whose audience it is.
    pub(super) server: ServerUrl,
    pub(super) ice_servers: IceServers,
    /// What the sender announced last.
    pub(super) announced: watch::Receiver<Announcement>,
    pub(super) clock: Clock,
    pub(super) forwarded: broadcast::Sender<Forwarded>,
    /// The session of the connection to the sender, once there is one.
    pub(super) source: watch::Receiver<Option<Source>>,
    pub(super) stop: watch::Receiver<bool>,
    pub(super) counts: Arc<Counts>,
    pub(super) most: usize,
}

/// How a viewer gets its answer. Dropped once it is connected, or cannot be.
#[async_trait::async_trait]
pub(super) trait Reply: Send {
    /// Answers this offer to an avatar of this announcement with `answer`, and with what the forwarder shows of itself. Once.
    async fn answer(
        &mut self,
        announced: Announcement,
        offer: &Description,
        answer: &str,
    ) -> Result<(), CallError>;
}

/// A place among the viewers; dropping it frees it.
pub(super) struct Place(Arc<Counts>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.begun.fetch_sub(1, Relaxed);
    }
}

impl Stage {
    /// A place for one more viewer, if there is one.
    pub(super) fn place(&self) -> Option<Place> {
        let begun = self.counts.begun.fetch_add(1, Relaxed);
        let place = Place(Arc::clone(&self.counts));
        (begun < self.most).then_some(place)
    }

    /// One viewer from its offer to its end.
    pub(super) async fn serve(
        mut self,
        _place: Place,
        offer: Description,
        mut reply: impl Reply,
        mut left: watch::Receiver<bool>,
    ) -> Result<(), CallError> {
        let plan = self.planner.plan(&self.server, &self.ice_servers).await;
        let announced = *self.announced.borrow();
        let (mut peer, answer) = Peer::answer(plan, announced.channel, &offer).await?;
        let introduced = timeout(OPEN_WITHIN, async {
            reply.answer(announced, &offer, &answer).await?;
            peer.introduced().await
        });
        let mut stop = self.stop.clone();
        let session = tokio::select! {
            session = introduced => session.map_err(|_| CallError::NotConnected)??,
            () = is_set(&mut left) => return Ok(()),
            () = is_set(&mut stop) => return Ok(()),
        };
        drop(reply);
        self.counts.viewers.fetch_add(1, Relaxed);
        self.counts.joined.fetch_add(1, Relaxed);
        let why = hand_on(&mut self, &mut peer, session, &mut left).await;
        self.counts.viewers.fetch_sub(1, Relaxed);
        log::debug!("a viewer has left (session {session:08x}): {why}");
        peer.close().await;
        Ok(())
    }

    /// A time of this side's clock by the sender's; nothing while the two are not compared.
    fn in_senders_time(&self, here: Micros) -> Option<Micros> {
        let offset = self.counts.offset_us.load(Relaxed);
        (offset != UNKNOWN).then(|| Micros(here.0.saturating_add_signed(offset)))
    }
}

/// Hands on to one viewer until either leaves; why it ended.
async fn hand_on(
    stage: &mut Stage,
    peer: &mut Peer,
    session: u32,
    left: &mut watch::Receiver<bool>,
) -> &'static str {
    let mut forwarded = stage.forwarded.subscribe();
    let mut silent_at = Instant::now() + VIEWER_SILENCE;
    let mut out = Vec::with_capacity(64);
    let (mut telling, mut times_told) = (Repeated::default(), 0u32);
    loop {
        tokio::select! {
            () = is_set(left) => return "it left",
            changed = stage.source.changed() => {
                if changed.is_err() {
                    return "this side has ended";
                }
                (telling, times_told) = (Repeated::default(), 0);
            }
            // Also while there is no sender: it is the sign of life for which the viewer stays.
            () = telling.due() => {
                let source = stage.source.borrow_and_update().clone();
                if let Some(Source { session: of, seal }) = source {
                    Message::Forwarded { of }.write(session, &mut out);
                    peer.try_send(&out).await;
                    let due = times_told < SEALS_APART || times_told.is_multiple_of(SEALS_APART);
                    if due && let Some(lines) = seal {
                        sealed::write_seal(session, &lines, &mut out);
                        peer.try_send(&out).await;
                    }
                    times_told = times_told.wrapping_add(1);
                }
            }
            () = is_set(&mut stage.stop) => {
                send_bye(peer, session).await;
                return "this side has ended";
            }
            next = forwarded.recv() => {
                let counts = &stage.counts;
                let is_sent = match next {
                    Ok(Forwarded::Motion(bytes)) => {
                        peer.try_send(&bytes).await == SendOutcome::Queued
                    }
                    Ok(Forwarded::State(state)) => {
                        Message::State(state).write(session, &mut out);
                        peer.try_send(&out).await == SendOutcome::Queued
                    }
                    Ok(Forwarded::Voice(VoicePacket { timestamp, opus })) => {
                        peer.send_voice(timestamp, opus).await
                    }
                    Err(broadcast::error::RecvError::Lagged(lost)) => {
                        counts.skipped.fetch_add(lost, Relaxed);
                        continue;
                    }
                    Err(broadcast::error::RecvError::Closed) => return "the sender has ended",
                };
                let count = if is_sent { &counts.sent } else { &counts.skipped };
                count.fetch_add(1, Relaxed);
            }
            event = peer.next() => {
                let arrived = stage.clock.now();
                let bytes = match event {
                    PeerEvent::Message(bytes) => bytes,
                    PeerEvent::Open | PeerEvent::Voice(_) => continue,
                    PeerEvent::Closed => return "its connection is closed",
                };
                match Message::read(&bytes, session) {
                    Some(Message::Feedback(feedback)) => {
                        silent_at = Instant::now() + VIEWER_SILENCE;
                        let now = stage.clock.now();
                        let pong = stage.in_senders_time(arrived).zip(stage.in_senders_time(now));
                        if feedback.sent != Micros(0) && let Some((arrived, left)) = pong {
                            let pong = Pong { asked: feedback.sent, arrived, left };
                            Message::Pong(pong).write(session, &mut out);
                            peer.try_send(&out).await;
                        }
                    }
                    Some(Message::Bye) => {
                        answer_bye(peer, session).await;
                        return "it hung up";
                    }
                    Some(Message::Pong(_) | Message::State(_) | Message::Forwarded { .. } | Message::Watching { .. }) | None => {
                        log::debug!("ignored a message of {} bytes", bytes.len());
                    }
                }
            }
            () = sleep_until(silent_at) => return "it sent nothing for 4 s",
        }
    }
}
