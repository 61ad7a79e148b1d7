//! A member of a call within the test's own process.

use crate::house::{House, wait_for};
use identity::Identity;
use link_call::{Authentication, CallError, Credentials, Door, Sender, Viewer, membership};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::calls::{CallStatus, EnterRoom};
use link_protocol::{Announcement, CallLink, Name};
use link_voice::VoiceQueue;
use std::time::{Duration, Instant};
use tokio::time::sleep;

/// Someone with a key, and maybe with a seat.
pub(crate) struct Member<'a> {
    house: &'a House,
    pub(crate) link: CallLink,
    pub(crate) own: Credentials,
    clock: Clock,
}

impl<'a> Member<'a> {
    /// The one with the key of this seed.
    pub(crate) fn of(house: &'a House, link: &str, seed: u8) -> Self {
        Self {
            house,
            link: link.parse().expect("a call's link"),
            own: Credentials::new(Identity::from_seed(&[seed; 32]).expect("a key")),
            clock: Clock::start(),
        }
    }

    /// Takes a seat as `occupant`, with the avatar that another member has put, and answers the keys that sit in the
    /// call from then on.
    pub(crate) fn sits(&self, occupant: &str) -> Result<Sender, CallError> {
        self.sits_with(occupant, Door::default())
    }

    /// The same, and lets in whom this door does.
    pub(crate) fn sits_with(&self, occupant: &str, door: Door) -> Result<Sender, CallError> {
        let announcement = Announcement {
            avatar: AvatarRef::of_file(&self.house.avatar).expect("the package"),
            channel: ChannelMode::default(),
            codec: Codec::default(),
            rate_hz: 30.0,
        };
        let entering = EnterRoom {
            occupant: Some(occupant.parse().expect("a name")),
            ..announcement.into()
        };
        let client = Client::new(None).expect("a client");
        let own = Some(self.own.clone());
        let sender = self.house.runtime.block_on(Sender::enter_call(
            client.clone(),
            self.link.clone(),
            entering,
            own,
            door.clone(),
            self.clock,
        ))?;
        let link = self.link.clone();
        self.house.runtime.spawn(async move {
            loop {
                let asked = Instant::now();
                if let Ok(status) = client.call_status(&link).await {
                    let taken = status.seats.iter().filter_map(|seat| seat.taken.as_ref());
                    let keys = taken.filter_map(|taken| membership::key_of(&link, taken).ok()?);
                    door.seat_members(asked, &keys.collect::<Vec<_>>());
                }
                sleep(Duration::from_millis(200)).await;
            }
        });
        Ok(sender)
    }

    /// Wants to see whoever sits there, with one's own key.
    pub(crate) fn watches(&self, seat: &Name) -> Viewer {
        self.watches_as(seat, Some(self.own.clone()))
    }

    /// The same with this key, or without one.
    pub(crate) fn watches_as(&self, seat: &Name, own: Option<Credentials>) -> Viewer {
        let _network = self.house.runtime.enter();
        let client = Client::new(None).expect("a client");
        let authentication = Authentication { own, signer: None };
        let (room, voice) = (self.link.seat(seat), VoiceQueue::default());
        Viewer::join(client, room, authentication, self.clock, voice)
    }

    /// What the server says of the call.
    pub(crate) fn status(&self) -> CallStatus {
        let client = Client::new(None).expect("a client");
        let status = self.house.runtime.block_on(client.call_status(&self.link));
        status.expect("the call is there")
    }

    /// The seat of the one who is called so.
    pub(crate) fn seat_of(&self, person: &str) -> Name {
        wait_for(&format!("{person} to sit in the call"), || {
            let named = |seat: &&link_protocol::calls::Seat| {
                let taken = seat.taken.as_ref();
                let name = taken.and_then(|taken| taken.person.as_ref());
                name.is_some_and(|name| name.as_str() == person)
            };
            let seats = self.status().seats;
            seats.iter().find(named).map(|seat| seat.room.clone())
        })
    }
}
