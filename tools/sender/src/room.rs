//! Enters a room: uploads the avatar if the store lacks it, and opens a room if none was given.

use crate::SendError;
use link_call::{CallError, Sender};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, RoomLink};
use std::path::PathBuf;

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
}

/// An open room, or a server to open one on.
#[derive(Debug, Clone)]
pub enum Place {
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
    },
}

impl Place {
    /// The server's address.
    #[must_use]
    pub fn server(&self) -> &ServerUrl {
        match self {
            Self::Room { link, .. } => link.server(),
            Self::Server { server, .. } => server,
        }
    }

    fn owner_token(&self) -> Option<&str> {
        match self {
            Self::Room { owner_token, .. } => owner_token.as_deref(),
            Self::Server { owner_token, .. } => Some(owner_token),
        }
    }
}

/// A sender in its room.
#[derive(Debug)]
pub struct Entered {
    /// Sends motion to the viewers.
    pub host: Sender,
    /// The sender's own link, with which to come back.
    pub sender: RoomLink,
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
    if let Some(token) = desk.place.owner_token() {
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
    let (sender, viewers) = match &desk.place {
        Place::Room { link, .. } => (link.clone(), None),
        Place::Server {
            server,
            owner_token,
        } => {
            let room = client
                .open_room(server, owner_token, None)
                .await
                .map_err(CallError::from)?;
            (room.sender, Some(room.viewer))
        }
    };
    let announcement = Announcement {
        avatar,
        channel: desk.channel,
        codec: desk.codec,
        rate_hz: desk.rate_hz,
    };
    let entered = Sender::enter(client.clone(), sender.clone(), announcement, clock).await;
    let host = match entered {
        // The room is there, for its token is good: it is the avatar that the store lacks.
        Err(error) if error.is_not_found() => {
            return Err(SendError::NotUploaded(desk.avatar.clone()));
        }
        entered => entered?,
    };
    Ok(Entered {
        host,
        sender,
        viewers,
    })
}
