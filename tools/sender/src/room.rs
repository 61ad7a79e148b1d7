//! Enters a room or a seat of a call: uploads the avatar if the store lacks it, and opens a room if none was given.

use crate::SendError;
use link_call::{CallError, Credentials, Door, Sender};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::calls::EnterRoom;
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, CallLink, LinkSecret, Name, PersonName, RoomLink};
use std::path::PathBuf;
use std::time::Duration;

/// What a sender needs to enter.
#[derive(Debug, Clone)]
pub struct Desk {
    /// An open room, or the server to open one on.
    pub place: Place,
    /// The avatar's package.
    pub avatar: PathBuf,
    /// How frames are written.
    pub codec: Codec,
    /// How the channel treats losses.
    pub channel: ChannelMode,
    /// Motions a second.
    pub rate_hz: f64,
    /// One's own key, which every viewer is shown; the viewers' link has it, too.
    pub credentials: Option<Credentials>,
    /// Who comes in.
    pub door: Door,
}

/// A seat of a call, an open room, or a server to open one on.
#[derive(Debug, Clone)]
pub enum Place {
    /// The first free seat of a call, by the link that everyone has who joins. Its members may put their avatars.
    Call {
        /// The call's link.
        link: CallLink,
        /// What the others read.
        name: Option<PersonName>,
    },
    /// A room by its sender's link. The owner's token is needed only where the store lacks the avatar.
    Room {
        /// The sender's link.
        link: RoomLink,
        /// The owner's token, to upload packages.
        owner_token: Option<String>,
    },
    /// A room yet to be opened.
    Server {
        /// The server.
        server: ServerUrl,
        /// The owner's token, to open rooms and upload packages.
        owner_token: String,
        /// How long the room's links hold; the server's choice where nothing is said.
        lifetime: Option<Duration>,
    },
}

impl Place {
    /// The server's address.
    #[must_use]
    pub fn server(&self) -> &ServerUrl {
        match self {
            Self::Call { link, .. } => link.server(),
            Self::Room { link, .. } => link.server(),
            Self::Server { server, .. } => server,
        }
    }

    /// A token with which packages may be put.
    fn store_token(&self) -> Option<&str> {
        match self {
            Self::Call { link, .. } => Some(link.token().secret()),
            Self::Room { owner_token, .. } => owner_token.as_deref(),
            Self::Server { owner_token, .. } => Some(owner_token),
        }
    }
}

/// A sender in its room.
#[derive(Debug)]
pub struct Entered {
    /// Sends motion to the viewers; its room's link is the one to come back with.
    pub host: Sender,
    /// The viewers' link, where the room was opened here.
    pub viewers: Option<RoomLink>,
}

/// Puts the avatar into the store if it is not there, reporting to `progress` the bytes done and in all; then opens the room if need be, and
/// enters it.
///
/// # Errors
/// If the package cannot be read, the server cannot be reached or refuses, or the right to put the package is wanting.
pub async fn enter(
    client: &Client,
    desk: &Desk,
    clock: Clock,
    progress: impl Fn(u64, u64) + Send + Sync + 'static,
) -> Result<Entered, SendError> {
    let file = desk.avatar.clone();
    let avatar = tokio::task::spawn_blocking(move || AvatarRef::of_file(&file))
        .await
        .map_err(CallError::from)?
        .map_err(CallError::from)?;
    if let Some(token) = desk.place.store_token() {
        let server = desk.place.server();
        if !client
            .has_package(server, token, &avatar.sha256)
            .await
            .map_err(CallError::from)?
        {
            client
                .put_package(server, token, &desk.avatar, progress)
                .await
                .map_err(CallError::from)?;
        }
    }
    let announcement = Announcement {
        avatar,
        channel: desk.channel,
        codec: desk.codec,
        rate_hz: desk.rate_hz,
    };
    let enter = async |room: &RoomLink| {
        Sender::enter(
            client.clone(),
            room.clone(),
            announcement,
            desk.credentials.clone(),
            desk.door.clone(),
            clock,
        )
        .await
    };
    match &desk.place {
        Place::Call { link, name } => {
            let entering = EnterRoom {
                person: name.clone(),
                occupant: Some(occupant()?),
                ..announcement.into()
            };
            let (client, link) = (client.clone(), link.clone());
            let credentials = desk.credentials.clone().map(|own| own.named(name.clone()));
            let door = desk.door.clone();
            let host = Sender::enter_call(client, link, entering, credentials, door, clock).await?;
            Ok(Entered {
                host,
                viewers: None,
            })
        }
        Place::Room { link, .. } => match enter(link).await {
            // The room is there, for its token is good: it is the avatar that the store lacks.
            Err(error) if error.is_not_found() => Err(SendError::NotUploaded(desk.avatar.clone())),
            entered => Ok(Entered {
                host: entered?,
                viewers: None,
            }),
        },
        Place::Server {
            server,
            owner_token,
            lifetime,
        } => {
            let room = client.open_room(server, owner_token, *lifetime).await;
            let room = room.map_err(CallError::from)?;
            let secret = new_secret()?;
            let viewers = room.viewer.with_secret(secret.clone());
            Ok(Entered {
                host: enter(&room.sender.with_secret(secret)).await?,
                viewers: Some(match &desk.credentials {
                    Some(own) => viewers.with_key(own.key().hash()),
                    None => viewers,
                }),
            })
        }
    }
}

/// The secret for a new link.
///
/// # Errors
/// If the system gives no random numbers.
pub fn new_secret() -> Result<LinkSecret, SendError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(CallError::from)?;
    Ok(LinkSecret::new(bytes))
}

/// Nobody else knows it.
fn occupant() -> Result<Name, SendError> {
    let mut id = [0; 16];
    getrandom::fill(&mut id).map_err(CallError::from)?;
    Ok(Name::of_id(id))
}
