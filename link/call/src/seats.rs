//! A sender's seat in a call of several: the first free one, and another where someone else has taken it meanwhile.

use crate::CallError;
use link_http::presence::Presence;
use link_http::{Client, HttpError};
use link_protocol::calls::{EnterRoom, Seat};
use link_protocol::limits::{MAX_PEOPLE, SEAT_KEPT};
use link_protocol::{CallLink, Name, RoomLink};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, sleep, timeout};

/// Seats that are tried: others may take one at the same moment.
const ATTEMPTS: usize = 2 * MAX_PEOPLE;

/// Between two looks whether a seat that is kept for someone has become free.
const LOOK_AGAIN: Duration = Duration::from_millis(500);

/// For the server to take note that a seat is left.
const LEAVE_WITHIN: Duration = Duration::from_secs(1);

/// Where a sender is met: in a room that was opened for it, or in a seat of a call, which may become another one. Clones share it.
#[derive(Debug, Clone)]
pub struct Venue {
    call: Option<CallLink>,
    room: Arc<Mutex<RoomLink>>,
}

impl Venue {
    /// Enters `room`.
    pub(crate) async fn of_room(
        client: &Client,
        room: RoomLink,
        entering: &EnterRoom,
    ) -> Result<(Self, Presence), CallError> {
        let presence = client.open_presence(&room, entering).await?;
        let venue = Self {
            call: None,
            room: Arc::new(Mutex::new(room)),
        };
        Ok((venue, presence))
    }

    /// Takes the first free seat of `call`.
    pub(crate) async fn of_call(
        client: &Client,
        call: CallLink,
        entering: &EnterRoom,
    ) -> Result<(Self, Presence), CallError> {
        let (seat, presence) = take_seat(client, &call, entering).await?;
        let venue = Self {
            call: Some(call),
            room: Arc::new(Mutex::new(seat)),
        };
        Ok((venue, presence))
    }

    /// The room's link, or that of the seat that was taken last.
    #[must_use]
    pub fn room(&self) -> RoomLink {
        self.locked().clone()
    }

    pub(crate) fn is_of_call(&self) -> bool {
        self.call.is_some()
    }

    /// Comes back after an outage: into the same room or seat, or into another seat where someone else sits there now.
    pub(crate) async fn come_back(
        &self,
        client: &Client,
        entering: &EnterRoom,
    ) -> Result<Presence, CallError> {
        let entered = client.open_presence(&self.room(), entering).await;
        match (entered, &self.call) {
            (Err(HttpError::SeatTaken), Some(call)) => {
                let (seat, presence) = take_seat(client, call, entering).await?;
                log::warn!("someone else sits in this side's seat now: another one is taken");
                *self.locked() = seat;
                Ok(presence)
            }
            (entered, _) => Ok(entered?),
        }
    }

    /// Tells the server that the seat of `occupant` is left on purpose, so that it is not kept.
    pub(crate) async fn leave(&self, client: &Client, occupant: Option<&Name>) {
        let (Some(_), Some(occupant)) = (&self.call, occupant) else {
            return;
        };
        let room = self.room();
        let left = timeout(LEAVE_WITHIN, client.leave_seat(&room, occupant));
        if !matches!(left.await, Ok(Ok(()))) {
            log::debug!("the server keeps the seat for a while");
        }
    }

    fn locked(&self) -> MutexGuard<'_, RoomLink> {
        // A link is whole after a panic elsewhere.
        self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn take_seat(
    client: &Client,
    call: &CallLink,
    entering: &EnterRoom,
) -> Result<(RoomLink, Presence), CallError> {
    let mut refused = Vec::new();
    let mut why = CallError::Full;
    let until = Instant::now() + SEAT_KEPT + LOOK_AGAIN;
    let mut attempts = 0;
    while attempts < ATTEMPTS {
        let status = client.call_status(call).await?;
        let is_free =
            |seat: &&Seat| seat.taken.is_none() && !seat.kept && !refused.contains(&seat.room);
        let Some(free) = status.seats.iter().find(is_free) else {
            // Whoever was there may have been this side, which was killed.
            if status.seats.iter().any(|seat| seat.kept) && Instant::now() < until {
                sleep(LOOK_AGAIN).await;
                continue;
            }
            break;
        };
        attempts += 1;
        let seat = call.seat(&free.room);
        match client.open_presence(&seat, entering).await {
            // Another one was faster.
            Err(HttpError::SeatTaken) => {}
            // Another server does not say whether one sits there.
            Err(error @ HttpError::Unavailable { .. }) => {
                refused.push(free.room.clone());
                why = error.into();
            }
            // One of those seats may be this side's own, which was killed: the server keeps it for a while.
            Err(error @ HttpError::TooManySeats { .. }) => {
                if !status.seats.iter().any(|seat| seat.kept) || Instant::now() >= until {
                    return Err(error.into());
                }
                attempts -= 1;
                sleep(LOOK_AGAIN).await;
            }
            entered => return Ok((seat, entered?)),
        }
    }
    Err(why)
}
