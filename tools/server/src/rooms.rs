//! The rooms whose senders are connected to this instance. A room exists while its sender's presence stream is open, and nothing else is
//! kept of rooms: tokens say what their bearer may do.

mod kept;
mod waiting;

use crate::Id;
use crate::metrics::Metrics;
use kept::Kept;
use link_protocol::calls::{EnterRoom, MemberProof};
use link_protocol::presence::PresenceEvent;
use link_protocol::{Announcement, Name, PackageId, PersonName};
use serde::{Deserialize, Serialize};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;
use waiting::Waiting;

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
        /// The network that it came from, as the sender is told it.
        #[serde(default)]
        network: Option<Id>,
    },
    /// The sender's answer to a viewer's offer.
    Answer { session: Id, sdp: String },
    /// The viewer of this session leaves.
    Leave { session: Id },
    /// The seat's occupant leaves it on purpose: it is not kept.
    LeaveSeat { occupant: Name },
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
        /// Which key it shows the call's other members.
        #[serde(default)]
        proof: Option<MemberProof>,
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
    of: Occupancy,
    sender: EnterRoom,
    events: mpsc::Sender<PresenceEvent>,
    waiting: Mutex<Waiting>,
    answer_within: Duration,
    /// It leaves on purpose, or has no right to the room any more.
    leaves: AtomicBool,
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

    /// The room is not kept for this sender once its stream ends.
    pub(crate) fn leave(&self) {
        self.leaves.store(true, Relaxed);
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
                proof: self.sender.proof.clone(),
            },
            RoomRequest::Offer {
                session,
                sdp,
                forwards,
                viewer,
                network,
            } => {
                let offer = PresenceEvent::Offer {
                    session: session.into(),
                    sdp,
                    forwards,
                    token: viewer.map(Name::from),
                    network: network.map(Name::from),
                };
                self.offer(session, network, offer).await
            }
            RoomRequest::Answer { session, sdp } => {
                let waiting = lock(&self.waiting).end(session);
                // A viewer that has just hung up no longer waits either.
                match waiting.map(|waiting| waiting.send(sdp)) {
                    Some(Ok(())) => RoomReply::Done,
                    _ => RoomReply::Unknown,
                }
            }
            RoomRequest::Leave { session } => self.notify(PresenceEvent::Leave {
                session: session.into(),
            }),
            RoomRequest::LeaveSeat { occupant } => {
                if self.sender.occupant == Some(occupant) {
                    self.leave();
                }
                RoomReply::Done
            }
        }
    }

    /// Whether the sender has revoked the viewer's token of this name.
    pub(crate) fn has_revoked(&self, viewer: Option<Id>) -> bool {
        let is = |viewer: Id| self.sender.revoked.contains(&viewer.into());
        viewer.is_some_and(is)
    }

    async fn offer(&self, session: Id, network: Option<Id>, offer: PresenceEvent) -> RoomReply {
        let Some(answered) = lock(&self.waiting).begin(session, network) else {
            return RoomReply::Busy;
        };
        let _waiting = WaitingGuard {
            presence: self,
            session,
        };
        match self.notify(offer) {
            RoomReply::Done => {}
            other => return other,
        }
        tokio::select! {
            // It made room for another network's viewer.
            sdp = answered => sdp.map_or(RoomReply::Busy, |sdp| RoomReply::Answer { sdp }),
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
        lock(&self.presence.waiting).end(self.session);
    }
}

/// The rooms whose senders are connected here.
#[derive(Debug)]
pub(crate) struct Rooms {
    present: Mutex<Present>,
    limits: RoomLimits,
    metrics: Arc<Metrics>,
}

#[derive(Debug, Default)]
struct Present {
    senders: HashMap<Id, Arc<Presence>>,
    kept: Kept,
}

/// The owner and the network that a room is counted for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Occupancy {
    /// The room's owner.
    pub(crate) owner: Id,
    /// The network of the seat's occupant of a call.
    pub(crate) network: Option<Id>,
}

/// The seats of a call, and how many of them one network may have.
#[derive(Debug)]
pub(crate) struct CallSeats {
    pub(crate) rooms: Vec<Id>,
    pub(crate) per_network: usize,
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
    /// The network has as many seats of the call as it may have.
    TooManySeats,
}

impl Rooms {
    pub(crate) fn new(limits: RoomLimits, metrics: Arc<Metrics>) -> Self {
        Self {
            present: Mutex::default(),
            limits,
            metrics,
        }
    }

    /// Lets a sender in, in a call into one of its `seats`. The room's sender before is replaced, unless it sits there
    /// as another occupant, or the seat is kept for another one.
    pub(crate) fn enter(
        self: &Arc<Self>,
        room: Id,
        connection: Id,
        of: Occupancy,
        seats: Option<&CallSeats>,
        sender: EnterRoom,
    ) -> Result<(PresenceGuard, mpsc::Receiver<PresenceEvent>), NotEntered> {
        // An offer and a leave for each viewer that may wait at once.
        let (events, received) = mpsc::channel(2 * self.limits.waiting_per_room.max(1));
        let presence = Arc::new(Presence {
            connection,
            of,
            sender,
            events,
            waiting: Mutex::new(Waiting::new(self.limits.waiting_per_room)),
            answer_within: self.limits.answer_within,
            leaves: AtomicBool::new(false),
            replaced: CancellationToken::new(),
            gone: CancellationToken::new(),
        });
        let mut present = lock(&self.present);
        let occupant = present.occupant(room);
        if is_of_another(occupant, &presence.sender) {
            return Err(NotEntered::Taken);
        }
        if occupant.is_none() && !present.senders.contains_key(&room) {
            let mut of_owner = 0;
            let mut all = 0;
            for (_, other) in present.all() {
                all += 1;
                of_owner += usize::from(other.owner == of.owner);
            }
            if all >= self.limits.rooms || of_owner >= self.limits.rooms_per_owner {
                return Err(NotEntered::TooManyRooms);
            }
        }
        if let Some(seats) = seats {
            let is_near = |(other, at): &(Id, Occupancy)| {
                *other != room && at.network == of.network && seats.rooms.contains(other)
            };
            if present.all().filter(is_near).count() >= seats.per_network {
                return Err(NotEntered::TooManySeats);
            }
        }
        present.kept.release(room);
        if let Some(before) = present.senders.insert(room, Arc::clone(&presence)) {
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
        lock(&self.present).senders.get(&room).cloned()
    }

    /// Whether this seat is kept for its occupant.
    pub(crate) fn is_kept(&self, seat: Id) -> bool {
        lock(&self.present).kept.occupant(seat).is_some()
    }

    /// Does not keep this seat for `occupant` any longer.
    pub(crate) fn release(&self, seat: Id, occupant: &Name) {
        let mut present = lock(&self.present);
        if present.kept.occupant(seat) == Some(occupant) {
            present.kept.release(seat);
        }
    }

    /// The avatars that are shown in this owner's rooms here.
    pub(crate) fn shown(&self, owner: Id) -> HashSet<PackageId> {
        let present = lock(&self.present);
        let of_owner = present.senders.values();
        of_owner
            .filter(|p| p.of.owner == owner)
            .map(|p| p.sender.announcement.avatar.sha256)
            .collect()
    }

    fn count(&self, present: &Present) {
        self.metrics
            .rooms
            .set(i64::try_from(present.senders.len()).unwrap_or(i64::MAX));
    }
}

impl Present {
    /// Who sits in this seat, or for whom it is kept.
    fn occupant(&self, room: Id) -> Option<&Name> {
        match self.senders.get(&room) {
            Some(presence) => presence.sender.occupant.as_ref(),
            None => self.kept.occupant(room),
        }
    }

    /// All rooms that are taken or kept.
    fn all(&self) -> impl Iterator<Item = (Id, Occupancy)> {
        let taken = self.senders.iter();
        let taken = taken.map(|(room, presence)| (*room, presence.of));
        taken.chain(self.kept.all())
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
        if let Entry::Occupied(entry) = present.senders.entry(self.room)
            && Arc::ptr_eq(entry.get(), &self.presence)
        {
            entry.remove();
            let Presence {
                sender, of, leaves, ..
            } = &*self.presence;
            if let Some(occupant) = &sender.occupant
                && !leaves.load(Relaxed)
            {
                present.kept.keep(self.room, occupant.clone(), *of);
            }
        }
        self.rooms.count(&present);
    }
}

/// A panic while the lock was held is ignored: no map is ever left half-changed.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
