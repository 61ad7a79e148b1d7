//! The forwarder's side towards the audience: a task for each viewer.

use super::{Counts, Forwarded, OPEN_WITHIN, UNKNOWN};
use crate::introduction::{self, Credentials};
use crate::peer::{Peer, PeerEvent, SendOutcome};
use crate::plan::Planner;
use crate::voice_track::VoicePacket;
use crate::{Backoff, CallError, answer_bye, is_set, send_bye};
use identity::{Keyring, Permit, PublicKey};
use link_codec::Micros;
use link_http::presence::Presence;
use link_http::{Client, HttpError};
use link_playout::Clock;
use link_protocol::calls::EnterRoom;
use link_protocol::data_channel::{Message, Pong};
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, IceServers, Name, RoomLink};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep, sleep_until, timeout};

/// A viewer that says nothing for so long is gone.
const VIEWER_SILENCE: Duration = Duration::from_secs(4);

/// A viewer is told so many times at first under which session the sender writes, and then again and again, also while there is no sender: each message may be lost, and a viewer that hears
/// nothing for 0.8 s connects again.
const TOLD_AT_ONCE: u32 = 3;
const TOLD_AGAIN: [Duration; 2] = [Duration::from_millis(100), Duration::from_millis(400)];

/// What the tasks of the viewers share.
#[derive(Clone)]
pub(super) struct Stage {
    pub(super) client: Client,
    pub(super) planner: Planner,
    pub(super) ice_servers: IceServers,
    pub(super) audience: RoomLink,
    /// What the sender announced last.
    pub(super) announced: watch::Receiver<Announcement>,
    /// This side's own key and the permits for it.
    pub(super) keys: Option<(Keyring, Arc<[Permit]>)>,
    /// Who the sender is, where it says so.
    pub(super) sender: watch::Receiver<Option<PublicKey>>,
    pub(super) clock: Clock,
    pub(super) forwarded: broadcast::Sender<Forwarded>,
    /// The session of the connection to the sender, while there is one.
    pub(super) source: watch::Receiver<Option<u32>>,
    pub(super) stop: watch::Receiver<bool>,
    pub(super) counts: Arc<Counts>,
    pub(super) most: usize,
}

async fn next_event(
    stage: &Stage,
    entering: &EnterRoom,
    presence: &mut Option<Presence>,
    backoff: &mut Backoff,
) -> PresenceEvent {
    loop {
        if let Some(open) = presence {
            match open.next().await {
                Ok(event) => return event,
                Err(error) => {
                    log::warn!(
                        "the server cannot be reached ({error}): viewers stay, trying again"
                    );
                    *presence = None;
                }
            }
        }
        sleep(backoff.next()).await;
        match stage.client.open_presence(&stage.audience, entering).await {
            Ok(open) => {
                backoff.reset();
                *presence = Some(open);
            }
            Err(HttpError::Unauthorized { .. }) => {
                log::warn!("the audience's room has expired: viewers stay, no other one can join");
                return std::future::pending().await;
            }
            Err(error) => log::debug!("not in the audience's room: {error}"),
        }
    }
}

/// One viewer from its offer to its end.
async fn serve(
    mut stage: Stage,
    session: &Name,
    offer: String,
    mut left: watch::Receiver<bool>,
) -> Result<(), CallError> {
    let server = stage.audience.server();
    let plan = stage.planner.plan(server, &stage.ice_servers).await;
    let room = &stage.audience;
    introduction::admit_viewer(&stage.client, room, session, &offer).await?;
    let announced = *stage.announced.borrow();
    let own = stage
        .keys
        .as_ref()
        .map(|(keys, permits)| Credentials::of_forwarder(keys, permits, *stage.sender.borrow()));
    let (mut peer, answer) = Peer::answer(plan, announced.channel, offer.clone()).await?;
    let avatar = announced.avatar.sha256;
    let answer = introduction::introduce_sender(own.as_ref(), room, avatar, &offer, &answer)?;
    let introduced = timeout(OPEN_WITHIN, async {
        stage
            .client
            .answer(&stage.audience, session, &answer)
            .await?;
        peer.opened().await?;
        loop {
            match peer.next().await {
                PeerEvent::Message(bytes) => {
                    if let Some(session) = Message::session_of_feedback(&bytes) {
                        return Ok::<_, CallError>(session);
                    }
                }
                PeerEvent::Closed => return Err(CallError::NotConnected),
                PeerEvent::Open | PeerEvent::Voice(_) => {}
            }
        }
    });
    let mut stop = stage.stop.clone();
    let session = tokio::select! {
        session = introduced => session.map_err(|_| CallError::NotConnected)??,
        () = is_set(&mut left) => return Ok(()),
        () = is_set(&mut stop) => return Ok(()),
    };
    stage.counts.viewers.fetch_add(1, Relaxed);
    stage.counts.joined.fetch_add(1, Relaxed);
    let why = hand_on(&mut stage, &mut peer, session, &mut left).await;
    stage.counts.viewers.fetch_sub(1, Relaxed);
    log::debug!("a viewer has left (session {session:08x}): {why}");
    peer.close().await;
    Ok(())
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
    let (mut times_told, mut tell_at) = (0, Instant::now());
    loop {
        tokio::select! {
            () = is_set(left) => return "it left",
            changed = stage.source.changed() => {
                if changed.is_err() {
                    return "this side has ended";
                }
                (times_told, tell_at) = (0, Instant::now());
            }
            () = sleep_until(tell_at) => {
                let source = *stage.source.borrow_and_update();
                if let Some(of) = source {
                    Message::Forwarded { of }.write(session, &mut out);
                    peer.try_send(&out).await;
                    times_told += 1;
                }
                let [soon, later] = TOLD_AGAIN;
                tell_at = Instant::now() + if times_told < TOLD_AT_ONCE { soon } else { later };
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
                    Some(Message::Pong(_) | Message::State(_) | Message::Forwarded { .. }) | None => {
                        log::debug!("ignored a message of {} bytes", bytes.len());
                    }
                }
            }
            () = sleep_until(silent_at) => return "it sent nothing for 4 s",
        }
    }
}

impl Stage {
    /// Keeps up the presence in the audience's room, and has a task for every viewer.
    pub(super) async fn attend(mut self, mut entering: EnterRoom, presence: Presence) {
        let mut presence = Some(presence);
        let mut viewers = JoinSet::new();
        let mut leaving: HashMap<Name, watch::Sender<bool>> = HashMap::new();
        let mut backoff = Backoff::default();
        let mut stop = self.stop.clone();
        let mut announced = self.announced.clone();
        loop {
            let event = tokio::select! {
                () = is_set(&mut stop) => break,
                Ok(()) = announced.changed() => {
                    // The sender is back with another avatar, say: viewers read that where they join.
                    entering = EnterRoom::from(*announced.borrow_and_update());
                    presence = None;
                    for (_, leave) in leaving.drain() {
                        leave.send_replace(true);
                    }
                    continue;
                }
                Some(_) = viewers.join_next(), if !viewers.is_empty() => {
                    leaving.retain(|_, leave| !leave.is_closed());
                    continue;
                }
                event = next_event(&self, &entering, &mut presence, &mut backoff) => event,
            };
            match event {
                PresenceEvent::Offer { session, sdp } => {
                    if viewers.len() >= self.most {
                        log::warn!("a viewer is refused: there are {} already", self.most);
                        continue;
                    }
                    let (leave, left) = watch::channel(false);
                    leaving.insert(session.clone(), leave);
                    let stage = self.clone();
                    viewers.spawn(async move {
                        if let Err(error) = serve(stage, &session, sdp, left).await {
                            log::debug!("a viewer could not join: {error}");
                        }
                    });
                }
                PresenceEvent::IceServers(servers) => self.ice_servers = servers,
                PresenceEvent::Leave { session } => {
                    if let Some(leave) = leaving.remove(&session) {
                        leave.send_replace(true);
                    }
                }
                PresenceEvent::Replaced => {
                    log::warn!("another one forwards to this audience now: new viewers go there");
                    is_set(&mut stop).await;
                    break;
                }
            }
        }
        drop(presence);
        while viewers.join_next().await.is_some() {}
    }

    /// A time of this side's clock by the sender's; nothing while the two are not compared.
    fn in_senders_time(&self, here: Micros) -> Option<Micros> {
        let offset = self.counts.offset_us.load(Relaxed);
        (offset != UNKNOWN).then(|| Micros(here.0.saturating_add_signed(offset)))
    }
}
