//! The sending side of a call: present in a room, it answers every viewer's offer and sends each viewer the newest motion.
//!
//! Each viewer has a task, a connection and an encoder of its own, so that a viewer's bad network does not affect the others. Where the server
//! forwards, only so many are served so; the server is one viewer more, which hands on what is sealed for it.

mod attendance;
mod ending;
mod hearing;
mod serving;
mod watching;

use crate::admission::{MOST_OPENING, Opening, Refusals};
use crate::door::{Door, MOST_INSIDE};
use crate::epochs::Epochs;
use crate::introduction::Credentials;
use crate::losses::WantedCopies;
use crate::path::Path;
use crate::plan::Planner;
use crate::privacy::Privacy;
use crate::seats::Venue;
use crate::{CallError, addresses, is_set, membership, now, renew};
use attendance::Attendance;
use ending::{end_sessions, end_who_is_over};
use hearing::Hearing;
use link_codec::{Codec, Micros, MotionFrame};
use link_http::Client;
use link_http::presence::Presence;
use link_playout::Clock;
use link_protocol::announcement::ChannelMode;
use link_protocol::calls::EnterRoom;
use link_protocol::limits::{MAX_PEOPLE, MAX_REVOKED};
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, CallLink, IceServers, Name, PackageId, RoomLink};
use link_voice::Voice;
use serde::Serialize;
use serving::{Offer, serve_viewer};
use spmm3::MotionParams;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, Semaphore, broadcast, watch};
use tokio::task::JoinSet;
use tokio::time::Instant;
use watching::Watching;

/// Viewers at once that are served directly where the server forwards to more: as many as may sit in a call.
const DIRECT_VIEWERS: usize = MAX_PEOPLE;

/// Forwarders at once: each instance of the server may have one.
const MAX_FORWARDERS: usize = 8;

/// The shortest time from one doubt to the next: each costs a connection to the server.
const DOUBT_AGAIN: Duration = Duration::from_secs(3);

/// Packets of voice that may wait for a viewer's task: a fifth of a second.
const VOICE_WAITING: usize = 10;

/// A sender's presence in a room, and its viewers.
#[derive(Debug)]
pub struct Sender {
    venue: Venue,
    frames: watch::Sender<Arc<MotionFrame>>,
    voice: broadcast::Sender<Voice>,
    privacy: Privacy,
    copies: WantedCopies,
    offered: Arc<Notify>,
    stop: watch::Sender<bool>,
    task: tokio::task::JoinHandle<()>,
    watching: Watching,
    counts: Arc<Counts>,
}

/// What has been sent so far, to all viewers together.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct SenderStatistics {
    /// Frames captured.
    pub captured: u32,
    /// Viewers connected now, a server that forwards among them.
    pub viewers: usize,
    /// Viewers that watch through the server, as it says.
    pub watching: u64,
    /// Viewers that connected so far; one that comes back counts again.
    pub joined: u64,
    /// Frames handed to the network.
    pub sent: u64,
    /// Frames left out because too much was waiting for the network, or because the next one had been captured already.
    pub skipped: u64,
    /// Bytes of the frames sent, without any header.
    pub payload_bytes: u64,
    /// Frames encoded, counted for each viewer.
    pub encoded: u64,
    /// The time that encoding them took together, nanoseconds.
    pub encode_ns: u64,
    /// Packets of voice handed to the network.
    pub voice_sent: u64,
    /// Bytes of the same, without any header.
    pub voice_bytes: u64,
    /// The ways that the last viewers' connections took, the newest last.
    pub paths: Vec<Path>,
}

#[derive(Debug, Default)]
struct Counts {
    paths: Mutex<Vec<Path>>,
    viewers: AtomicUsize,
    joined: AtomicU64,
    sent: AtomicU64,
    skipped: AtomicU64,
    payload_bytes: AtomicU64,
    encoded: AtomicU64,
    encode_ns: AtomicU64,
    voice_sent: AtomicU64,
    voice_bytes: AtomicU64,
}

impl Counts {
    fn paths(&self) -> MutexGuard<'_, Vec<Path>> {
        self.paths.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn took(&self, path: Path) {
        let mut paths = self.paths();
        if paths.len() >= MOST_INSIDE {
            paths.remove(0);
        }
        paths.push(path);
    }
}

/// What a sender serves itself where its server forwards. A place is taken from the offer on: who never connects has others handed over, and keeps nobody
/// out.
#[derive(Debug, Clone)]
struct Places {
    /// Whether the server forwards, as it says anew in each presence.
    forwards: Arc<AtomicBool>,
    viewers: Arc<Semaphore>,
    forwarders: Arc<Semaphore>,
}

impl Places {
    /// The server does not forward, unless it says so again.
    fn without_forwarder(&self) {
        self.forwards.store(false, Relaxed);
    }
}

impl Default for Places {
    fn default() -> Self {
        Self {
            forwards: Arc::default(),
            viewers: Arc::new(Semaphore::new(DIRECT_VIEWERS)),
            forwarders: Arc::new(Semaphore::new(MAX_FORWARDERS)),
        }
    }
}

/// What the tasks share.
#[derive(Debug, Clone)]
struct Shared {
    client: Client,
    planner: Planner,
    /// What the server told last.
    ice_servers: IceServers,
    venue: Venue,
    codec: Codec,
    channel: ChannelMode,
    avatar: PackageId,
    credentials: Option<Credentials>,
    door: Door,
    clock: Clock,
    frames: watch::Receiver<Arc<MotionFrame>>,
    voice: broadcast::Sender<Voice>,
    privacy: Privacy,
    copies: WantedCopies,
    offered: Arc<Notify>,
    stop: watch::Receiver<bool>,
    /// Which viewers are silent, and that so many are that this side's own way is in doubt.
    hearing: Hearing,
    doubt: Arc<Notify>,
    /// For viewers and for the server's forwarders, where it forwards.
    places: Places,
    refusals: Refusals,
    opening: Opening,
    watching: Watching,
    /// The keys of what the server's forwarders hand on.
    epochs: Epochs,
    counts: Arc<Counts>,
}

impl Sender {
    /// Enters `room` and answers viewers from then on, in tasks of the current tokio runtime. If the server goes away, calls go on, and
    /// the room is entered again when the server is back. With `credentials` every viewer is shown who answers it. `door` says who comes in.
    ///
    /// # Errors
    /// If the server cannot be reached or refuses the link or the announcement.
    pub async fn enter(
        client: Client,
        room: RoomLink,
        announcement: Announcement,
        credentials: Option<Credentials>,
        door: Door,
        clock: Clock,
    ) -> Result<Self, CallError> {
        let entering = EnterRoom {
            revoked: door.revoked(MAX_REVOKED, now()),
            ..announcement.into()
        };
        let (venue, presence) = Venue::of_room(&client, room, &entering).await?;
        Ok(Self::start(
            client,
            venue,
            presence,
            entering,
            credentials,
            door,
            clock,
        ))
    }

    /// As [`Self::enter`], in the first free seat of `call`. Whoever loses it in an outage takes another one. Viewers
    /// are taken alone whose keys sit in the call, as `door` is told by [`Door::seat_members`].
    ///
    /// # Errors
    /// [`CallError::Full`], or as [`Self::enter`].
    pub async fn enter_call(
        client: Client,
        call: CallLink,
        mut entering: EnterRoom,
        credentials: Option<Credentials>,
        door: Door,
        clock: Clock,
    ) -> Result<Self, CallError> {
        entering.proof = (credentials.as_ref()).and_then(|own| membership::prove(own, &call));
        let (venue, presence) = Venue::of_call(&client, call, &entering).await?;
        Ok(Self::start(
            client,
            venue,
            presence,
            entering,
            credentials,
            door,
            clock,
        ))
    }

    fn start(
        client: Client,
        venue: Venue,
        presence: Presence,
        entering: EnterRoom,
        credentials: Option<Credentials>,
        door: Door,
        clock: Clock,
    ) -> Self {
        let announcement = entering.announcement;
        let (frames, newest) = watch::channel(Arc::default());
        let voice = broadcast::Sender::new(VOICE_WAITING);
        let privacy = Privacy::default();
        let offered = Arc::<Notify>::default();
        let (stop, stopped) = watch::channel(false);
        let counts = Arc::<Counts>::default();
        let copies = WantedCopies::default();
        let watching = Watching::default();
        let shared = Shared {
            client,
            planner: Planner::default(),
            ice_servers: IceServers::default(),
            venue: venue.clone(),
            codec: announcement.codec,
            channel: announcement.channel,
            avatar: announcement.avatar.sha256,
            credentials,
            door,
            clock,
            frames: newest,
            voice: voice.clone(),
            privacy: privacy.clone(),
            copies: copies.clone(),
            offered: Arc::clone(&offered),
            stop: stopped,
            hearing: Hearing::default(),
            doubt: Arc::default(),
            places: Places::default(),
            refusals: Refusals::default(),
            opening: Opening::new(MOST_OPENING),
            watching: watching.clone(),
            epochs: Epochs::default(),
            counts: Arc::clone(&counts),
        };
        let task = tokio::spawn(answer_viewers(shared, entering, presence));
        Self {
            venue,
            frames,
            voice,
            privacy,
            copies,
            offered,
            stop,
            task,
            watching,
            counts,
        }
    }

    /// Where viewers meet this sender.
    #[must_use]
    pub fn venue(&self) -> Venue {
        self.venue.clone()
    }

    /// Sends `motion`, captured at `captured` by the sender's clock, to every viewer, unless the person is hidden. Never waits: a viewer's task
    /// that is still busy with the frame before skips it.
    pub fn publish(&self, captured: Micros, motion: &MotionParams) {
        if self.privacy.state().hidden {
            return;
        }
        let sequence = self.frames.borrow().sequence + 1;
        self.frames.send_replace(Arc::new(MotionFrame {
            sequence,
            captured,
            motion: motion.clone(),
        }));
    }

    /// Sends a packet of voice to every viewer that asked for it. Never waits.
    pub fn say(&self, voice: Voice) {
        // Without a viewer no task listens.
        let _ = self.voice.send(voice);
    }

    /// Whether the person is heard and seen, which every viewer is told, now and later ones. While they are hidden no motion is sent; what is said is
    /// silenced where it is encoded.
    #[must_use]
    pub fn privacy(&self) -> Privacy {
        self.privacy.clone()
    }

    /// Is notified of every viewer's offer: in a call of several it tells of a newcomer.
    #[must_use]
    pub fn offers(&self) -> Arc<Notify> {
        Arc::clone(&self.offered)
    }

    /// Whether a viewer's network loses packets, or may: voice is to be sent with copies then. They take bits, so it is without them else.
    #[must_use]
    pub fn wants_copies(&self) -> bool {
        self.copies.any()
    }

    /// What has been sent so far.
    #[must_use]
    pub fn statistics(&self) -> SenderStatistics {
        let counts = &self.counts;
        SenderStatistics {
            captured: self.frames.borrow().sequence,
            viewers: counts.viewers.load(Relaxed),
            watching: self.watching.viewers(),
            joined: counts.joined.load(Relaxed),
            sent: counts.sent.load(Relaxed),
            skipped: counts.skipped.load(Relaxed),
            payload_bytes: counts.payload_bytes.load(Relaxed),
            encoded: counts.encoded.load(Relaxed),
            encode_ns: counts.encode_ns.load(Relaxed),
            voice_sent: counts.voice_sent.load(Relaxed),
            voice_bytes: counts.voice_bytes.load(Relaxed),
            paths: counts.paths().clone(),
        }
    }

    /// Hangs up on every viewer and leaves the room. Returns the last statistics, with the viewers connected until then.
    pub async fn hang_up(mut self) -> SenderStatistics {
        let SenderStatistics {
            viewers, watching, ..
        } = self.statistics();
        self.stop.send_replace(true);
        if let Err(error) = (&mut self.task).await {
            log::error!("a task of the call failed: {error}");
        }
        SenderStatistics {
            viewers,
            watching,
            ..self.statistics()
        }
    }
}

/// Keeps up the presence and starts a task for every viewer's offer.
async fn answer_viewers(mut shared: Shared, mut entering: EnterRoom, presence: Presence) {
    let mut stop = shared.stop.clone();
    let mut attendance = Attendance::new(presence);
    let mut viewers = JoinSet::new();
    let mut leaving: HashMap<Name, watch::Sender<bool>> = HashMap::new();
    let mut forwarders: HashSet<Name> = HashSet::new();
    let mut here = addresses::Watch::begin();
    let (doubt, door) = (Arc::clone(&shared.doubt), shared.door.clone());
    let mut doubted: Option<Instant> = None;
    // Apart: it must not interrupt an attempt to come back into the room.
    let looks = tokio::spawn(end_who_is_over(door.clone()));
    loop {
        let event = tokio::select! {
            () = is_set(&mut stop) => break,
            () = here.lost() => {
                renew(&mut shared.client);
                attendance.renew("this machine's address has changed", &shared, &entering);
                // What the new network lets through is found out before the viewers' new offers come.
                let ahead = shared.clone();
                tokio::spawn(async move {
                    let room = ahead.venue.room();
                    ahead.planner.plan(room.server(), &ahead.ice_servers).await;
                });
                continue;
            }
            () = doubt.notified() => {
                if doubted.is_none_or(|last| last.elapsed() > DOUBT_AGAIN) {
                    renew(&mut shared.client);
                    attendance.renew("viewers are silent", &shared, &entering);
                    doubted = Some(Instant::now());
                }
                continue;
            }
            () = door.changed() => {
                let ended = door.take_sessions_to_end();
                ended.iter().for_each(|session| shared.epochs.leave(session));
                tokio::spawn(end_sessions(shared.clone(), ended));
                let revoked = door.revoked(MAX_REVOKED, now());
                if revoked != entering.revoked {
                    entering.revoked = revoked;
                    attendance.renew("a guest's link is revoked", &shared, &entering);
                }
                continue;
            }
            event = attendance.next(&shared, &entering) => event,
            Some(_) = viewers.join_next(), if !viewers.is_empty() => {
                leaving.retain(|_, leave| !leave.is_closed());
                forwarders.retain(|session| leaving.contains_key(session));
                continue;
            }
        };
        match event {
            PresenceEvent::Offer {
                session,
                sdp,
                forwards,
                token,
                network,
            } => {
                shared.offered.notify_one();
                if let Some(oldest) = shared.opening.begin(&session, network.as_ref())
                    && let Some(leave) = leaving.remove(&oldest)
                {
                    leave.send_replace(true);
                }
                let (leave, left) = watch::channel(false);
                leaving.insert(session.clone(), leave);
                if forwards {
                    forwarders.insert(session.clone());
                }
                let shared = shared.clone();
                viewers.spawn(async move {
                    let (refusals, opening) = (shared.refusals.clone(), shared.opening.clone());
                    let offer = Offer {
                        sdp,
                        forwards,
                        token,
                        network,
                    };
                    if let Err(error) = serve_viewer(shared, &session, offer, left).await {
                        refusals.tell(&error);
                    }
                    opening.end(&session);
                });
            }
            PresenceEvent::IceServers(servers) => shared.ice_servers = servers,
            PresenceEvent::Forwards => shared.places.forwards.store(true, Relaxed),
            PresenceEvent::Leave { session } => {
                shared.door.left(&session);
                shared.epochs.leave(&session);
                if let Some(leave) = leaving.remove(&session) {
                    leave.send_replace(true);
                }
            }
            // Another server of the same call did not know yet that the seat was taken.
            PresenceEvent::Replaced if shared.venue.is_of_call() => attendance.lose(),
            PresenceEvent::Replaced => {
                log::warn!("another sender has entered the room: new viewers go there");
                // Whoever the other one hands over is forwarded to from there; the viewers of this sender itself may stay.
                for session in &forwarders {
                    if let Some(leave) = leaving.remove(session) {
                        leave.send_replace(true);
                    }
                }
                is_set(&mut stop).await;
                break;
            }
        }
    }
    let leaves = shared
        .venue
        .leave(&shared.client, entering.occupant.as_ref());
    leaves.await;
    drop(attendance);
    looks.abort();
    while viewers.join_next().await.is_some() {}
}
