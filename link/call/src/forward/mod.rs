//! Forwarding for an audience: one viewer of a sender hands on what it receives to many viewers of a room of its own, so that the sender sends once.
//!
//! A [`Forwarder`] has a room and a link of its own for its audience, and the link of the sender; it is believed. [`Halls`] are a server's: they have no link, and
//! what they hand on is sealed.
//!
//! Messages of motion and packets of voice go on as they came: nothing is decoded. Each viewer is told under which session the sender writes. Motion that is predicted from what one viewer has acknowledged would be of no use to another, so the forwarder acknowledges nothing, and each frame
//! stands by itself. Times stay those of the sender: a viewer that compares clocks is answered in the sender's time.

mod audience;
mod halls;
mod room;
mod upstream;

pub use halls::Halls;

use crate::CallError;
use crate::plan::Planner;
use crate::signaling::{HttpRoom, Signaling};
use crate::voice_track::VoicePacket;
use audience::Stage;
use bytes::Bytes;
use identity::{Keyring, PublicKey};
use link_http::Client;
use link_playout::Clock;
use link_protocol::calls::EnterRoom;
use link_protocol::data_channel::State;
use link_protocol::{Announcement, IceServers, RoomLink};
use room::AudienceRoom;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;
use tokio::sync::{broadcast, watch};
use tokio::task::JoinHandle;
use upstream::{Until, Upstream};

/// What may wait for one viewer: a third of a second of motion and voice.
const WAITING: usize = 32;

/// From the offer to the open channel, on either side.
const OPEN_WITHIN: Duration = Duration::from_secs(10);

/// No offset is known.
const UNKNOWN: i64 = i64::MIN;

/// What goes on to every viewer.
#[derive(Debug, Clone)]
enum Forwarded {
    Motion(Bytes),
    State(State),
    Voice(VoicePacket),
}

/// Under which session the sender writes, and by which lines what it seals is opened.
#[derive(Debug, Clone)]
struct Source {
    session: u32,
    seal: Option<Arc<str>>,
}

impl Source {
    fn of(session: u32) -> Self {
        Self {
            session,
            seal: None,
        }
    }

    /// The newest lines; whether viewers are to be told at once, for there were none.
    fn seal_with(&mut self, lines: &str) -> bool {
        self.seal.replace(lines.into()).is_none()
    }
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
    /// Viewers from their offers on.
    begun: AtomicUsize,

    viewers: AtomicUsize,
    joined: AtomicU64,
    messages: AtomicU64,
    voice: AtomicU64,
    sent: AtomicU64,
    skipped: AtomicU64,
    /// The sender's clock less this side's, microseconds.
    offset_us: AtomicI64,
}

impl Default for Counts {
    fn default() -> Self {
        Self {
            begun: AtomicUsize::new(0),
            viewers: AtomicUsize::new(0),
            joined: AtomicU64::new(0),
            messages: AtomicU64::new(0),
            voice: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            skipped: AtomicU64::new(0),
            offset_us: AtomicI64::new(UNKNOWN),
        }
    }
}

/// What was forwarded so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ForwarderStatistics {
    /// Viewers now.
    pub viewers: usize,
    /// Viewers that connected so far.
    pub joined: u64,
    /// Frames that came from the sender.
    pub messages: u64,
    /// Packets of voice that came from the sender.
    pub voice: u64,
    /// Messages and packets handed to the network, to all viewers together.
    pub sent: u64,
    /// Those left out because too much waited for a viewer.
    pub skipped: u64,
}

impl Forwarder {
    /// Joins the sender of `source` as a viewer, and hands on what comes to at most `most` viewers of `audience`, which this side enters
    /// as its sender. In tasks of the current tokio runtime, until it is stopped; the sender may come and go meanwhile, also as another
    /// avatar, which the viewers are told. Viewers are shown the key of `keys`, and a permit in it of the sender's, without which they take nobody
    /// but the sender where the avatar is signed.
    ///
    /// # Errors
    /// If the sender is not there, the room for the audience cannot be entered, or the permits cannot be read.
    pub async fn begin(
        client: Client,
        source: RoomLink,
        audience: RoomLink,
        most: usize,
        keys: Option<Keyring>,
        clock: Clock,
    ) -> Result<Self, CallError> {
        let permits = keys.as_ref().map_or(Ok(Vec::new()), Keyring::permits)?;
        let status = client.room_status(&source).await?;
        let announcement = status.ok_or(CallError::SenderAbsent)?.announcement;
        let entering = EnterRoom::from(announcement);
        let presence = client.open_presence(&audience, &entering).await?;
        let (stop, stopped) = watch::channel(false);
        let signaling = HttpRoom {
            client: client.clone(),
            room: source,
        };
        let (stage, mut upstream, sender) = begin(
            Arc::new(signaling),
            announcement,
            clock,
            most,
            stopped,
            false,
        );
        let counts = Arc::clone(&stage.counts);
        let room = AudienceRoom {
            client,
            link: audience,
            keys: keys.map(|keys| (keys, permits.into())),
            sender,
        };
        let task = tokio::spawn(async move {
            tokio::join!(
                upstream.run(Until::Stopped),
                room.attend(stage, entering, presence)
            );
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

/// The two sides of a forwarder, before either has begun, and who the sender is.
fn begin(
    signaling: Arc<dyn Signaling>,
    announcement: Announcement,
    clock: Clock,
    most: usize,
    stop: watch::Receiver<bool>,
    only_sealed: bool,
) -> (Stage, Upstream, watch::Receiver<Option<PublicKey>>) {
    let (telling, source) = watch::channel(None);
    let (meeting, sender) = watch::channel(None);
    let (announcing, announced) = watch::channel(announcement);
    let stage = Stage {
        planner: Planner::default(),
        server: signaling.room().server().clone(),
        ice_servers: IceServers::default(),
        announced,
        clock,
        forwarded: broadcast::Sender::new(WAITING),
        source,
        stop,
        counts: Arc::default(),
        most,
    };
    let upstream = Upstream {
        signaling,
        planner: Planner::default(),
        clock,
        announcing,
        telling,
        meeting,
        forwarded: stage.forwarded.clone(),
        counts: Arc::clone(&stage.counts),
        stop: stage.stop.clone(),
        only_sealed,
    };
    (stage, upstream, sender)
}
