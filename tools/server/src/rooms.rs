//! The rooms whose senders are connected to this instance. A room exists while its sender's presence stream is open, and nothing else is
//! kept of rooms: tokens say what their bearer may do.

use crate::Id;
use crate::metrics::Metrics;
use link_protocol::calls::EnterRoom;
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, Name, PackageId, PersonName};
use serde::{Deserialize, Serialize};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

/// A request to a room's sender, from this instance or another one.
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
pub(crate) enum RoomRequest {
    /// For the sender's announcement.
    Announcement {
        /// The name of the token of the viewer who asks, if one does.
        #[serde(default)]
        viewer: Option<Id>,
    },
    /// A viewer's offer; the reply is the sender's answer.
    Offer {
        session: Id,
        sdp: String,
        /// It is of an instance's own forwarder.
        #[serde(default)]
        forwards: bool,
        /// The name of the viewer's token.
        #[serde(default)]
        viewer: Option<Id>,
    },
    /// The sender's answer to a viewer's offer.
    Answer { session: Id, sdp: String },
    /// The viewer of this session leaves.
    Leave { session: Id },
}

/// The reply to a [`RoomRequest`].
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "reply", rename_all = "lowercase")]
pub(crate) enum RoomReply {
    /// The sender's announcement.
    Announcement {
        announcement: Announcement,
        /// What it is called.
        #[serde(default)]
        person: Option<PersonName>,
        /// What it said to take a seat; never told to a client.
        #[serde(default)]
        occupant: Option<Name>,
    },
    /// The sender's answer.
    Answer { sdp: String },
    /// The request was passed on.
    Done,
    /// No viewer waits for this answer.
    Unknown,
    /// The sender has revoked the viewer's token.
    Revoked,
    /// The sender did not answer in time.
    Unanswered,
    /// Too many viewers wait already.
    Busy,
    /// The sender is absent.
    Absent,
    /// The other instances cannot be reached, and the sender may be connected to one of them.
    Unreachable,
}

/// A connected sender.
#[derive(Debug)]
pub(crate) struct Presence {
    /// A random number of this connection: the same sender's next one has another.
    #[cfg_attr(
        not(feature = "nats"),
        expect(dead_code, reason = "only other instances are told")
    )]
    connection: Id,
    owner: Id,
    sender: EnterRoom,
    events: mpsc::Sender<PresenceEvent>,
    waiting: Mutex<HashMap<Id, oneshot::Sender<String>>>,
    waiting_limit: usize,
    answer_within: Duration,
    /// Another sender has replaced it.
    replaced: CancellationToken,
    /// Its stream has ended.
    gone: CancellationToken,
}

impl Presence {
    /// Ends this presence because another sender has entered the room.
    pub(crate) fn replace(&self) {
        self.replaced.cancel();
    }

    #[cfg(feature = "nats")]
    pub(crate) fn connection(&self) -> Id {
        self.connection
    }

    pub(crate) fn replaced(&self) -> CancellationToken {
        self.replaced.clone()
    }

    #[cfg(feature = "nats")]
    pub(crate) fn gone(&self) -> CancellationToken {
        self.gone.clone()
    }

    /// Answers for the sender, or asks it.
    pub(crate) async fn ask(&self, request: RoomRequest) -> RoomReply {
        match request {
            RoomRequest::Announcement { viewer } | RoomRequest::Offer { viewer, .. }
                if self.has_revoked(viewer) =>
            {
                RoomReply::Revoked
            }
            RoomRequest::Announcement { .. } => RoomReply::Announcement {
                announcement: self.sender.announcement,
                person: self.sender.person.clone(),
                occupant: self.sender.occupant.clone(),
            },
            RoomRequest::Offer {
                session,
                sdp,
                forwards,
                viewer,
            } => {
                let offer = PresenceEvent::Offer {
                    session: session.into(),
                    sdp,
                    forwards,
                    token: viewer.map(Name::from),
                };
                self.offer(session, offer).await
            }
            RoomRequest::Answer { session, sdp } => {
                let waiting = lock(&self.waiting).remove(&session);
                // A viewer that has just hung up no longer waits either.
                match waiting.map(|waiting| waiting.send(sdp)) {
                    Some(Ok(())) => RoomReply::Done,
                    _ => RoomReply::Unknown,
                }
            }
            RoomRequest::Leave { session } => self.notify(PresenceEvent::Leave {
                session: session.into(),
            }),
        }
    }

    /// Whether the sender has revoked the viewer's token of this name.
    pub(crate) fn has_revoked(&self, viewer: Option<Id>) -> bool {
        let is = |viewer: Id| self.sender.revoked.contains(&viewer.into());
        viewer.is_some_and(is)
    }

    async fn offer(&self, session: Id, offer: PresenceEvent) -> RoomReply {
        let (answer, answered) = oneshot::channel();
        {
            let mut waiting = lock(&self.waiting);
            if waiting.len() >= self.waiting_limit {
                return RoomReply::Busy;
            }
            waiting.insert(session, answer);
        }
        let _waiting = WaitingGuard {
            presence: self,
            session,
        };
        match self.notify(offer) {
            RoomReply::Done => {}
            other => return other,
        }
        tokio::select! {
            sdp = answered => sdp.map_or(RoomReply::Absent, |sdp| RoomReply::Answer { sdp }),
            () = self.gone.cancelled() => RoomReply::Absent,
            () = tokio::time::sleep(self.answer_within) => RoomReply::Unanswered,
        }
    }

    fn notify(&self, event: PresenceEvent) -> RoomReply {
        match self.events.try_send(event) {
            Ok(()) => RoomReply::Done,
            Err(mpsc::error::TrySendError::Full(_)) => RoomReply::Busy,
            Err(mpsc::error::TrySendError::Closed(_)) => RoomReply::Absent,
        }
    }
}

/// Removes a viewer from those that wait when its request ends in any way.
struct WaitingGuard<'a> {
    presence: &'a Presence,
    session: Id,
}

impl Drop for WaitingGuard<'_> {
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

/// The bounds on rooms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomLimits {
    pub(crate) rooms: usize,
    pub(crate) rooms_per_owner: usize,
    pub(crate) waiting_per_room: usize,
    pub(crate) answer_within: Duration,
}

/// The error of a sender that cannot enter.
#[derive(Debug)]
pub(crate) enum NotEntered {
    /// There are too many rooms, of its owner or of all.
    TooManyRooms,
    /// The seat is another's.
    Taken,
}

impl Rooms {
    pub(crate) fn new(limits: RoomLimits, metrics: Arc<Metrics>) -> Self {
        Self {
            present: Mutex::default(),
            limits,
            metrics,
        }
    }

    /// Lets a sender in. The room's sender before is replaced, unless it sits there as another occupant.
    pub(crate) fn enter(
        self: &Arc<Self>,
        room: Id,
        connection: Id,
        owner: Id,
        sender: EnterRoom,
    ) -> Result<(PresenceGuard, mpsc::Receiver<PresenceEvent>), NotEntered> {
        // An offer and a leave for each viewer that may wait at once.
        let (events, received) = mpsc::channel(2 * self.limits.waiting_per_room.max(1));
        let presence = Arc::new(Presence {
            connection,
            owner,
            sender,
            events,
            waiting: Mutex::default(),
            waiting_limit: self.limits.waiting_per_room,
            answer_within: self.limits.answer_within,
            replaced: CancellationToken::new(),
            gone: CancellationToken::new(),
        });
        let mut present = lock(&self.present);
        if let Some(before) = present.get(&room) {
            if is_of_another(before.sender.occupant.as_ref(), &presence.sender) {
                return Err(NotEntered::Taken);
            }
        } else {
            let of_owner = present.values().filter(|p| p.owner == owner).count();
            if present.len() >= self.limits.rooms || of_owner >= self.limits.rooms_per_owner {
                return Err(NotEntered::TooManyRooms);
            }
        }
        if let Some(before) = present.insert(room, Arc::clone(&presence)) {
            before.replace();
        }
        self.count(&present);
        drop(present);
        let guard = PresenceGuard {
            rooms: Arc::clone(self),
            room,
            presence,
        };
        Ok((guard, received))
    }

    /// The room's sender, if it is connected here.
    pub(crate) fn presence(&self, room: Id) -> Option<Arc<Presence>> {
        lock(&self.present).get(&room).cloned()
    }

    /// The avatars that are shown in this owner's rooms here.
    pub(crate) fn shown(&self, owner: Id) -> HashSet<PackageId> {
        let present = lock(&self.present);
        let of_owner = present.values().filter(|p| p.owner == owner);
        of_owner
            .map(|p| p.sender.announcement.avatar.sha256)
            .collect()
    }

    fn count(&self, present: &HashMap<Id, Arc<Presence>>) {
        self.metrics
            .rooms
            .set(i64::try_from(present.len()).unwrap_or(i64::MAX));
    }
}

/// Whether the seat of `occupant` is not that of who wants to enter.
pub(crate) fn is_of_another(occupant: Option<&Name>, entering: &EnterRoom) -> bool {
    occupant.is_some() && occupant != entering.occupant.as_ref()
}

/// Ends a sender's presence when it is dropped.
#[derive(Debug)]
pub(crate) struct PresenceGuard {
    rooms: Arc<Rooms>,
    room: Id,
    pub(crate) presence: Arc<Presence>,
}

impl Drop for PresenceGuard {
    fn drop(&mut self) {
        self.presence.gone.cancel();
        let mut present = lock(&self.rooms.present);
        // A sender that replaced this one stays.
        if let Entry::Occupied(entry) = present.entry(self.room)
            && Arc::ptr_eq(entry.get(), &self.presence)
        {
            entry.remove();
        }
        self.rooms.count(&present);
    }
}

/// A panic while the lock was held is ignored: no map is ever left half-changed.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
