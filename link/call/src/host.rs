//! The sending side of a call: present in a room, it answers every viewer who comes and sends each of them the newest motion.
//!
//! A viewer has a task, a connection and an encoder of its own, so one with a bad network costs nobody else anything.

use crate::peer::{Peer, PeerEvent, Sent};
use crate::{Backoff, CallError, local_addresses, part, part_too, raised};
use link_codec::{Codec, Encoder, Micros, MotionFrame};
use link_http::presence::{Presence, PresenceEvent};
use link_http::{Client, HttpError};
use link_playout::Clock;
use link_protocol::announcement::ChannelMode;
use link_protocol::message::{Message, Pong};
use link_protocol::{Announcement, RoomLink};
use serde::Serialize;
use spmm3::MotionParams;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};

/// Viewers at once: what a home's uplink carries easily.
const MOST_VIEWERS: usize = 32;

/// From an offer to the open channel.
const OPENING: Duration = Duration::from_secs(10);

/// A viewer speaks at least five times a second; after this long it is gone.
const GONE: Duration = Duration::from_secs(4);

/// A sender's presence in a room, and its viewers.
#[derive(Debug)]
pub struct Host {
    frames: watch::Sender<Arc<MotionFrame>>,
    stop: watch::Sender<bool>,
    task: tokio::task::JoinHandle<()>,
    counts: Arc<Counts>,
}

/// What has been sent so far, to all viewers together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct HostStatistics {
    /// Frames captured.
    pub captured: u32,
    /// Viewers who are there now.
    pub viewers: usize,
    /// Viewers who ever came; one that comes back counts again.
    pub joined: u64,
    /// Frames handed to the network.
    pub sent: u64,
    /// Frames left out because too much was waiting for the network, or because the next one was there already.
    pub skipped: u64,
    /// Bytes of the frames sent, without any header.
    pub payload_bytes: u64,
    /// Frames encoded, for each viewer anew.
    pub encoded: u64,
    /// What encoding them took, all together, nanoseconds.
    pub encode_ns: u64,
}

#[derive(Debug, Default)]
struct Counts {
    viewers: AtomicUsize,
    joined: AtomicU64,
    sent: AtomicU64,
    skipped: AtomicU64,
    payload_bytes: AtomicU64,
    encoded: AtomicU64,
    encode_ns: AtomicU64,
}

/// What the tasks share.
#[derive(Debug, Clone)]
struct Shared {
    client: Client,
    room: RoomLink,
    codec: Codec,
    channel: ChannelMode,
    clock: Clock,
    frames: watch::Receiver<Arc<MotionFrame>>,
    stop: watch::Receiver<bool>,
    counts: Arc<Counts>,
}

impl Host {
    /// Enters `room` and answers viewers from then on, in tasks of the current tokio runtime. If the server goes away, the
    /// calls go on and presence is taken up again when it is back.
    ///
    /// # Errors
    /// If the server cannot be reached or refuses the link or the announcement.
    pub async fn enter(
        client: Client,
        room: RoomLink,
        announcement: Announcement,
        clock: Clock,
    ) -> Result<Self, CallError> {
        let presence = client.present(&room, &announcement).await?;
        let (frames, newest) = watch::channel(Arc::default());
        let (stop, stopped) = watch::channel(false);
        let counts = Arc::<Counts>::default();
        let shared = Shared {
            client,
            room,
            codec: announcement.codec,
            channel: announcement.channel,
            clock,
            frames: newest,
            stop: stopped,
            counts: Arc::clone(&counts),
        };
        let task = tokio::spawn(answer_viewers(shared, announcement, presence));
        Ok(Self {
            frames,
            stop,
            task,
            counts,
        })
    }

    /// Sends `motion`, captured at `captured` by the host's clock, to every viewer. Never waits: a viewer that has not sent the
    /// one before skips it.
    pub fn publish(&self, captured: Micros, motion: &MotionParams) {
        let sequence = self.frames.borrow().sequence + 1;
        self.frames.send_replace(Arc::new(MotionFrame {
            sequence,
            captured,
            motion: motion.clone(),
        }));
    }

    /// Figures so far.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        let counts = &self.counts;
        HostStatistics {
            captured: self.frames.borrow().sequence,
            viewers: counts.viewers.load(Relaxed),
            joined: counts.joined.load(Relaxed),
            sent: counts.sent.load(Relaxed),
            skipped: counts.skipped.load(Relaxed),
            payload_bytes: counts.payload_bytes.load(Relaxed),
            encoded: counts.encoded.load(Relaxed),
            encode_ns: counts.encode_ns.load(Relaxed),
        }
    }

    /// Says goodbye to every viewer and leaves the room. Returns the last figures, with the viewers who were there until then.
    pub async fn hang_up(mut self) -> HostStatistics {
        let HostStatistics { viewers, .. } = self.statistics();
        self.stop.send_replace(true);
        if let Err(error) = (&mut self.task).await {
            log::error!("a task of the call failed: {error}");
        }
        HostStatistics {
            viewers,
            ..self.statistics()
        }
    }
}

/// Keeps up the presence and starts a task for every viewer who comes.
async fn answer_viewers(shared: Shared, announcement: Announcement, presence: Presence) {
    let mut stop = shared.stop.clone();
    let mut presence = Some(presence);
    let mut viewers = JoinSet::new();
    let mut leaving: HashMap<String, watch::Sender<bool>> = HashMap::new();
    let mut backoff = Backoff::default();
    loop {
        let event = tokio::select! {
            () = raised(&mut stop) => break,
            event = next_event(&shared, &announcement, &mut presence, &mut backoff) => event,
            Some(_) = viewers.join_next(), if !viewers.is_empty() => {
                leaving.retain(|_, leave| !leave.is_closed());
                continue;
            }
        };
        match event {
            PresenceEvent::Offer { session, sdp } => {
                if viewers.len() >= MOST_VIEWERS {
                    log::warn!("a viewer is turned away: there are {MOST_VIEWERS} already");
                    continue;
                }
                let (leave, left) = watch::channel(false);
                leaving.insert(session.clone(), leave);
                let shared = shared.clone();
                viewers.spawn(async move {
                    if let Err(error) = serve_viewer(shared, &session, sdp, left).await {
                        log::warn!("a viewer could not join: {error}");
                    }
                });
            }
            PresenceEvent::Leave { session } => {
                if let Some(leave) = leaving.remove(&session) {
                    leave.send_replace(true);
                }
            }
            PresenceEvent::Replaced => {
                log::warn!("another sender has entered the room: nobody new comes here any more");
                // Who is here may stay.
                raised(&mut stop).await;
                break;
            }
        }
    }
    drop(presence);
    while viewers.join_next().await.is_some() {}
}

/// The presence's next event, after as many new presences as it takes.
async fn next_event(
    shared: &Shared,
    announcement: &Announcement,
    presence: &mut Option<Presence>,
    backoff: &mut Backoff,
) -> PresenceEvent {
    loop {
        if let Some(open) = presence {
            match open.next().await {
                Ok(event) => return event,
                Err(error) => {
                    log::warn!("the server is gone ({error}); calls go on, trying again");
                    *presence = None;
                }
            }
        }
        tokio::time::sleep(backoff.next()).await;
        match shared.client.present(&shared.room, announcement).await {
            Ok(open) => {
                log::info!("in the room again");
                backoff.reset();
                *presence = Some(open);
            }
            Err(HttpError::NotAccepted { .. }) => {
                log::warn!(
                    "the room has expired: calls go on, but nobody new gets in; open another room"
                );
                return std::future::pending().await;
            }
            Err(error) => log::debug!("not in the room: {error}"),
        }
    }
}

/// One viewer from its offer to its end.
async fn serve_viewer(
    mut shared: Shared,
    session: &str,
    offer: String,
    mut left: watch::Receiver<bool>,
) -> Result<(), CallError> {
    let local = local_addresses(shared.room.server());
    let (mut peer, answer) = Peer::answer(local, shared.channel, offer).await?;
    // The first feedback names the session.
    let introduced = timeout(OPENING, async {
        shared.client.answer(&shared.room, session, &answer).await?;
        peer.opened().await?;
        loop {
            match peer.next().await {
                PeerEvent::Message(bytes) => {
                    if let Some(session) = Message::session_of_feedback(&bytes) {
                        return Ok(session);
                    }
                }
                PeerEvent::Closed => return Err(CallError::NotConnected),
                PeerEvent::Open => {}
            }
        }
    });
    let mut stop = shared.stop.clone();
    let session = tokio::select! {
        session = introduced => session.map_err(|_| CallError::NotConnected)??,
        () = raised(&mut left) => return Ok(()),
        () = raised(&mut stop) => return Ok(()),
    };
    // Before anybody learns of this viewer: every frame captured for it is its own, from sequence 1 on.
    let before = shared.frames.borrow_and_update().sequence;
    let counts = Arc::clone(&shared.counts);
    counts.viewers.fetch_add(1, Relaxed);
    counts.joined.fetch_add(1, Relaxed);
    log::info!("a viewer has joined (session {session:08x})");
    let why = send_motion(&mut shared, before, &mut peer, session, &mut left).await;
    counts.viewers.fetch_sub(1, Relaxed);
    log::info!("a viewer has left (session {session:08x}): {why}");
    peer.close().await;
    Ok(())
}

/// Sends every frame after `before` until the viewer or this side leaves; returns why it ended.
async fn send_motion(
    shared: &mut Shared,
    before: u32,
    peer: &mut Peer,
    session: u32,
    left: &mut watch::Receiver<bool>,
) -> &'static str {
    let mut encoder = Encoder::new(shared.codec, session);
    let mut out = Vec::with_capacity(1024);
    let mut gone = Instant::now() + GONE;
    let mut last = before;
    loop {
        tokio::select! {
            // In this order: the last frame before the goodbye, the goodbye whatever a viewer floods this with, and what it said
            // before it counts as gone.
            biased;
            changed = shared.frames.changed() => {
                if changed.is_err() {
                    return "the sender has ended";
                }
                let captured = Arc::clone(&shared.frames.borrow_and_update());
                // Frames that came faster than this task took them.
                let passed_over = captured.sequence.saturating_sub(last.saturating_add(1));
                shared.counts.skipped.fetch_add(passed_over.into(), Relaxed);
                last = captured.sequence;
                let frame = MotionFrame {
                    sequence: captured.sequence.saturating_sub(before),
                    ..MotionFrame::clone(&captured)
                };
                let begun = std::time::Instant::now();
                encoder.encode(&frame, &mut out);
                let took = u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX);
                shared.counts.encoded.fetch_add(1, Relaxed);
                shared.counts.encode_ns.fetch_add(took, Relaxed);
                match peer.try_send(&out).await {
                    Sent::Queued => {
                        shared.counts.sent.fetch_add(1, Relaxed);
                        shared.counts.payload_bytes.fetch_add(out.len() as u64, Relaxed);
                    }
                    Sent::Skipped => {
                        shared.counts.skipped.fetch_add(1, Relaxed);
                    }
                    Sent::Closed => return "its channel is closed",
                }
            }
            () = raised(left) => return "it left",
            () = raised(&mut shared.stop) => {
                part(peer, session).await;
                return "the sender hung up";
            }
            event = peer.next() => {
                let arrived = shared.clock.now();
                let bytes = match event {
                    PeerEvent::Message(bytes) => bytes,
                    PeerEvent::Open => continue,
                    PeerEvent::Closed => return "its connection is closed",
                };
                match Message::read(&bytes, session) {
                    Some(Message::Feedback(feedback)) => {
                        gone = Instant::now() + GONE;
                        encoder.acknowledge(feedback.newest, feedback.received);
                        if feedback.sent != Micros(0) {
                            let pong = Pong { asked: feedback.sent, arrived, left: shared.clock.now() };
                            Message::Pong(pong).write(session, &mut out);
                            peer.try_send(&out).await;
                        }
                    }
                    Some(Message::Bye) => {
                        part_too(peer, session).await;
                        return "it said goodbye";
                    }
                    Some(Message::Pong(_)) | None => log::debug!("a message of {} bytes makes no sense", bytes.len()),
                }
            }
            () = sleep_until(gone) => return "nothing came from it for 4 s",
        }
    }
}
