//! Rooms as this instance knows them: a room is wherever its sender's presence stream is connected, and nowhere when
//! it is not. Nothing is kept of rooms besides; tokens say who may enter.

use crate::Id;
use crate::id::PackageHash;
use crate::metrics::Metrics;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

/// What a sender says of itself to those who may join.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Announcement {
    pub(crate) avatar: AvatarName,
    channel: Channel,
    codec: Codec,
    pub(crate) rate_hz: f64,
}

/// A package's name and length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AvatarName {
    pub(crate) sha256: PackageHash,
    pub(crate) bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Channel {
    Unreliable,
    Reliable,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Codec {
    Compact,
    Paper,
}

/// What is asked of a room, here or by another instance.
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
pub(crate) enum Ask {
    /// What does the sender say of itself?
    Announcement,
    /// A viewer's offer; the sender's answer is waited for.
    Offer { session: Id, sdp: String },
    /// The sender's answer to the viewer who waits for it.
    Answer { session: Id, sdp: String },
    /// The viewer of this session leaves.
    Leave { session: Id },
}

/// What comes back.
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "reply", rename_all = "lowercase")]
pub(crate) enum Reply {
    /// What the sender says of itself.
    Announcement { announcement: Announcement },
    /// The sender's answer.
    Answer { sdp: String },
    /// It was passed on.
    Done,
    /// Nobody waits for that.
    Unknown,
    /// The sender did not answer in time.
    Unanswered,
    /// Too many wait already.
    Busy,
    /// The sender is not there.
    Absent,
    /// Whether the sender is there cannot be told: instances do not reach each other.
    Unreachable,
}

/// What a sender is told.
#[derive(Debug)]
pub(crate) enum Event {
    Offer { session: Id, sdp: String },
    Leave { session: Id },
}

/// A sender that is there.
#[derive(Debug)]
pub(crate) struct Presence {
    /// What tells this stay from the same sender's others.
    stay: Id,
    owner: Id,
    announcement: Announcement,
    events: mpsc::Sender<Event>,
    waiting: Mutex<HashMap<Id, oneshot::Sender<String>>>,
    waiting_limit: usize,
    answer_within: Duration,
    /// Another has taken its place.
    replaced: CancellationToken,
    /// Its stream has ended.
    gone: CancellationToken,
}

impl Presence {
    /// Ends this presence because another has come.
    pub(crate) fn replace(&self) {
        self.replaced.cancel();
    }

    pub(crate) fn stay(&self) -> Id {
        self.stay
    }

    pub(crate) fn replaced(&self) -> CancellationToken {
        self.replaced.clone()
    }

    pub(crate) fn gone(&self) -> CancellationToken {
        self.gone.clone()
    }

    /// Answers for the sender, or asks it.
    pub(crate) async fn ask(&self, ask: Ask) -> Reply {
        match ask {
            Ask::Announcement => Reply::Announcement {
                announcement: self.announcement.clone(),
            },
            Ask::Offer { session, sdp } => self.offer(session, sdp).await,
            Ask::Answer { session, sdp } => {
                let waiting = lock(&self.waiting).remove(&session);
                // A viewer that has just hung up no longer waits either.
                match waiting.map(|waiting| waiting.send(sdp)) {
                    Some(Ok(())) => Reply::Done,
                    _ => Reply::Unknown,
                }
            }
            Ask::Leave { session } => self.tell(Event::Leave { session }),
        }
    }

    async fn offer(&self, session: Id, sdp: String) -> Reply {
        let (answer, answered) = oneshot::channel();
        {
            let mut waiting = lock(&self.waiting);
            if waiting.len() >= self.waiting_limit {
                return Reply::Busy;
            }
            waiting.insert(session, answer);
        }
        let _forget = Forget {
            presence: self,
            session,
        };
        match self.tell(Event::Offer { session, sdp }) {
            Reply::Done => {}
            other => return other,
        }
        tokio::select! {
            sdp = answered => sdp.map_or(Reply::Absent, |sdp| Reply::Answer { sdp }),
            () = self.gone.cancelled() => Reply::Absent,
            () = tokio::time::sleep(self.answer_within) => Reply::Unanswered,
        }
    }

    fn tell(&self, event: Event) -> Reply {
        match self.events.try_send(event) {
            Ok(()) => Reply::Done,
            Err(mpsc::error::TrySendError::Full(_)) => Reply::Busy,
            Err(mpsc::error::TrySendError::Closed(_)) => Reply::Absent,
        }
    }
}

/// Takes a viewer off the list when it no longer waits, for whatever reason.
struct Forget<'a> {
    presence: &'a Presence,
    session: Id,
}

impl Drop for Forget<'_> {
    fn drop(&mut self) {
        lock(&self.presence.waiting).remove(&self.session);
    }
}

/// The rooms whose senders are connected here.
#[derive(Debug)]
pub(crate) struct Rooms {
    present: Mutex<HashMap<Id, Arc<Presence>>>,
    limits: RoomLimits,
    metrics: Arc<Metrics>,
}

/// The bounds that concern rooms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomLimits {
    pub(crate) rooms: usize,
    pub(crate) rooms_per_owner: usize,
    pub(crate) waiting_per_room: usize,
    pub(crate) answer_within: Duration,
}

/// A sender cannot enter: there are too many rooms, of this owner or of all.
#[derive(Debug)]
pub(crate) struct TooManyRooms;

impl Rooms {
    pub(crate) fn new(limits: RoomLimits, metrics: Arc<Metrics>) -> Self {
        Self {
            present: Mutex::default(),
            limits,
            metrics,
        }
    }

    /// Lets a sender in. Whoever was there before is replaced.
    pub(crate) fn enter(
        self: &Arc<Self>,
        room: Id,
        stay: Id,
        owner: Id,
        announcement: Announcement,
    ) -> Result<(Stay, mpsc::Receiver<Event>), TooManyRooms> {
        // An offer and a leave for everyone who may wait at once.
        let (events, told) = mpsc::channel(2 * self.limits.waiting_per_room.max(1));
        let presence = Arc::new(Presence {
            stay,
            owner,
            announcement,
            events,
            waiting: Mutex::default(),
            waiting_limit: self.limits.waiting_per_room,
            answer_within: self.limits.answer_within,
            replaced: CancellationToken::new(),
            gone: CancellationToken::new(),
        });
        let mut present = lock(&self.present);
        if !present.contains_key(&room) {
            let of_owner = present.values().filter(|p| p.owner == owner).count();
            if present.len() >= self.limits.rooms || of_owner >= self.limits.rooms_per_owner {
                return Err(TooManyRooms);
            }
        }
        if let Some(before) = present.insert(room, Arc::clone(&presence)) {
            before.replace();
        }
        self.count(&present);
        drop(present);
        let stay = Stay {
            rooms: Arc::clone(self),
            room,
            presence,
        };
        Ok((stay, told))
    }

    /// The room's sender, if it is connected here.
    pub(crate) fn presence(&self, room: Id) -> Option<Arc<Presence>> {
        lock(&self.present).get(&room).cloned()
    }

    fn count(&self, present: &HashMap<Id, Arc<Presence>>) {
        self.metrics
            .rooms
            .set(i64::try_from(present.len()).unwrap_or(i64::MAX));
    }
}

/// A sender's stay in its room, which ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Stay {
    rooms: Arc<Rooms>,
    room: Id,
    pub(crate) presence: Arc<Presence>,
}

impl Drop for Stay {
    fn drop(&mut self) {
        self.presence.gone.cancel();
        let mut present = lock(&self.rooms.present);
        // Whoever replaced it stays.
        if let Entry::Occupied(entry) = present.entry(self.room)
            && Arc::ptr_eq(entry.get(), &self.presence)
        {
            entry.remove();
        }
        self.rooms.count(&present);
    }
}

/// None of these maps is ever left half-changed, so a panic elsewhere does not spoil them.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
