//! Forwarding for an audience: one viewer of a sender hands on what it receives to many viewers of a room of its own, so that the sender sends once.
//!
//! Messages of motion and packets of voice go on as they came: nothing is decoded. Each viewer is told under which session the sender writes. Motion that is predicted from what one viewer has acknowledged would be of no use to another, so the forwarder acknowledges nothing, and each frame
//! stands by itself. Times stay those of the sender: a viewer that compares clocks is answered in the sender's time.

use crate::peer::{Peer, PeerEvent, SendOutcome};
use crate::plan::Planner;
use crate::session::Session;
use crate::voice_track::VoicePacket;
use crate::{Backoff, CallError, answer_bye, is_set, send_bye};
use bytes::Bytes;
use link_codec::Micros;
use link_http::presence::Presence;
use link_http::{Client, HttpError};
use link_playout::Clock;
use link_playout::clock::Exchange;
use link_protocol::calls::EnterRoom;
use link_protocol::data_channel::{Message, Pong, State};
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, IceServers, Name, RoomLink};
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, sleep_until, timeout};

/// What may wait for one viewer: a third of a second of motion and voice.
const WAITING: usize = 32;

/// From the offer to the open channel, on either side.
const OPEN_WITHIN: Duration = Duration::from_secs(10);

/// A sender that says nothing for so long is joined again ...
const SILENCE: Duration = Duration::from_millis(800);

/// ... and a viewer that says nothing for so long is gone.
const VIEWER_SILENCE: Duration = Duration::from_secs(4);

/// How often silence and feedback are looked at.
const TICK: Duration = Duration::from_millis(50);

/// A viewer is told so many times at first under which session the sender writes, and then again and again: each message may be lost.
const TOLD_AT_ONCE: u32 = 3;
const TOLD_AGAIN: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(1)];

/// No offset is known.
const UNKNOWN: i64 = i64::MIN;

/// What goes on to every viewer.
#[derive(Debug, Clone)]
enum Forwarded {
    Motion(Bytes),
    State(State),
    Voice(VoicePacket),
}

/// Hands on what one sender sends.
#[derive(Debug)]
pub struct Forwarder {
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
    counts: Arc<Counts>,
}

#[derive(Debug)]
struct Counts {
    viewers: AtomicUsize,
    joined: AtomicU64,
    messages: AtomicU64,
    voice: AtomicU64,
    sent: AtomicU64,
    skipped: AtomicU64,
    /// The sender's clock less this side's, microseconds.
    offset_us: AtomicI64,
}

/// What was forwarded so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ForwarderStatistics {
    /// Viewers now.
    pub viewers: usize,
    /// Viewers that connected so far.
    pub joined: u64,
    /// Messages of motion and state that came from the sender.
    pub messages: u64,
    /// Packets of voice that came from the sender.
    pub voice: u64,
    /// Messages and packets handed to the network, to all viewers together.
    pub sent: u64,
    /// Those left out because too much waited for a viewer.
    pub skipped: u64,
}

/// What the tasks of the viewers share.
#[derive(Clone)]
struct Stage {
    client: Client,
    planner: Planner,
    ice_servers: IceServers,
    audience: RoomLink,
    announcement: Announcement,
    clock: Clock,
    forwarded: broadcast::Sender<Forwarded>,
    /// The session of the connection to the sender, while there is one.
    source: watch::Receiver<Option<u32>>,
    stop: watch::Receiver<bool>,
    counts: Arc<Counts>,
    most: usize,
}

impl Forwarder {
    /// Joins the sender of `source` as a viewer, and hands on what comes to at most `most` viewers of `audience`, which this side enters as its sender. In tasks of
    /// the current tokio runtime, until it is stopped; the sender may come and go meanwhile.
    ///
    /// # Errors
    /// If the sender is not there, or the room for the audience cannot be entered.
    pub async fn begin(
        client: Client,
        source: RoomLink,
        audience: RoomLink,
        most: usize,
        clock: Clock,
    ) -> Result<Self, CallError> {
        let status = client.room_status(&source).await?;
        let announcement = status.ok_or(CallError::SenderAbsent)?.announcement;
        let entering = EnterRoom::from(announcement);
        let presence = client.open_presence(&audience, &entering).await?;
        let (stop, stopped) = watch::channel(false);
        let counts = Arc::new(Counts {
            viewers: AtomicUsize::new(0),
            joined: AtomicU64::new(0),
            messages: AtomicU64::new(0),
            voice: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            skipped: AtomicU64::new(0),
            offset_us: AtomicI64::new(UNKNOWN),
        });
        let (telling, told) = watch::channel(None);
        let stage = Stage {
            client: client.clone(),
            planner: Planner::default(),
            ice_servers: IceServers::default(),
            audience,
            announcement,
            clock,
            forwarded: broadcast::Sender::new(WAITING),
            source: told,
            stop: stopped,
            counts: Arc::clone(&counts),
            most,
        };
        let task = tokio::spawn(async move {
            let upstream = Upstream {
                client,
                planner: Planner::default(),
                source,
                clock,
                telling,
                forwarded: stage.forwarded.clone(),
                counts: Arc::clone(&stage.counts),
                stop: stage.stop.clone(),
            };
            tokio::join!(upstream.run(), attend(stage, entering, presence));
        });
        Ok(Self { stop, task, counts })
    }

    /// What was forwarded so far.
    #[must_use]
    pub fn statistics(&self) -> ForwarderStatistics {
        let counts = &self.counts;
        ForwarderStatistics {
            viewers: counts.viewers.load(Relaxed),
            joined: counts.joined.load(Relaxed),
            messages: counts.messages.load(Relaxed),
            voice: counts.voice.load(Relaxed),
            sent: counts.sent.load(Relaxed),
            skipped: counts.skipped.load(Relaxed),
        }
    }

    /// Says goodbye to all viewers and to the sender.
    pub async fn end(self) -> ForwarderStatistics {
        let last = self.statistics();
        self.stop.send_replace(true);
        if let Err(error) = self.task.await {
            log::error!("a task of the audience failed: {error}");
        }
        last
    }
}

/// The side towards the sender.
struct Upstream {
    client: Client,
    planner: Planner,
    source: RoomLink,
    clock: Clock,
    telling: watch::Sender<Option<u32>>,
    forwarded: broadcast::Sender<Forwarded>,
    counts: Arc<Counts>,
    stop: watch::Receiver<bool>,
}

impl Upstream {
    async fn run(mut self) {
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
                    self.telling.send_replace(Some(session.id));
                    let why = self.pump(&mut session).await;
                    self.telling.send_replace(None);
                    self.counts.offset_us.store(UNKNOWN, Relaxed);
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
        let server = self.source.server();
        let plan = self.planner.plan(server, &status.ice_servers).await;
        let announcement = &status.announcement;
        Session::open(
            &self.client,
            &self.source,
            announcement,
            plan,
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
            Some(Message::Feedback(_) | Message::Forwarded { .. }) => {
                log::debug!("ignored a message that is no sender's");
            }
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

/// Keeps up the presence in the audience's room, and has a task for every viewer.
async fn attend(mut stage: Stage, entering: EnterRoom, presence: Presence) {
    let mut presence = Some(presence);
    let mut viewers = JoinSet::new();
    let mut leaving: HashMap<Name, watch::Sender<bool>> = HashMap::new();
    let mut backoff = Backoff::default();
    let mut stop = stage.stop.clone();
    loop {
        let event = tokio::select! {
            () = is_set(&mut stop) => break,
            Some(_) = viewers.join_next(), if !viewers.is_empty() => {
                leaving.retain(|_, leave| !leave.is_closed());
                continue;
            }
            event = next_event(&stage, &entering, &mut presence, &mut backoff) => event,
        };
        match event {
            PresenceEvent::Offer { session, sdp } => {
                if viewers.len() >= stage.most {
                    log::warn!("a viewer is refused: there are {} already", stage.most);
                    continue;
                }
                let (leave, left) = watch::channel(false);
                leaving.insert(session.clone(), leave);
                let stage = stage.clone();
                viewers.spawn(async move {
                    if let Err(error) = serve(stage, &session, sdp, left).await {
                        log::debug!("a viewer could not join: {error}");
                    }
                });
            }
            PresenceEvent::IceServers(servers) => stage.ice_servers = servers,
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
    let (mut peer, answer) = Peer::answer(plan, stage.announcement.channel, offer).await?;
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
    /// A time of this side's clock by the sender's; nothing while the two are not compared.
    fn in_senders_time(&self, here: Micros) -> Option<Micros> {
        let offset = self.counts.offset_us.load(Relaxed);
        (offset != UNKNOWN).then(|| Micros(here.0.saturating_add_signed(offset)))
    }
}
