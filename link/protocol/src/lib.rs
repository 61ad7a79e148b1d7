//! What the programs of a call send each other (`docs/protocol.md`), as types that the server, senders and viewers share. Each wire type
//! and each bound that both ends keep is written here once. The crate opens no connection; motion frames are the codec's
//! ([`link_codec`]).
//!
//! The course of a viewer's call, in these types: a [`RoomLink`] names the room, the [`Announcement`] names the avatar package
//! ([`PackageId`]) and which codec, offer and answer are SDP, and on the data channels the viewer answers motion with
//! [`Feedback`](data_channel::Feedback).
//!
//! ```
//! use link_protocol::{Announcement, RoomLink};
//!
//! let link: RoomLink = "https://call.example/rooms/r7#TOKEN".parse()?;
//! assert_eq!(link.room().as_str(), "r7");
//! assert_eq!(format!("{link:?}"), "https://call.example/rooms/r7#...", "a log shows no token");
//!
//! let announced = r#"{"avatar": {"sha256": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", "bytes": 3},
//!     "channel": "unreliable", "codec": "compact", "rate_hz": 30.0}"#;
//! let announcement: Announcement = serde_json::from_str(announced)?;
//! println!("the sender's avatar is package {}", announcement.avatar.sha256);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod announcement;
mod call_link;
pub mod calls;
pub mod data_channel;
mod error;
mod fragment;
mod guest;
pub mod ice;
pub mod limits;
mod link_secret;
mod name;
pub mod package_id;
mod person_name;
pub mod presence;
mod refusal;
pub mod room_link;
pub mod rooms;
pub mod sdp;
pub mod sealed;
mod token;

pub use announcement::Announcement;
pub use call_link::CallLink;
pub use error::ProtocolError;
pub use guest::{Guest, GuestPass, Rights};
pub use ice::IceServers;
pub use link_secret::LinkSecret;
pub use name::Name;
pub use package_id::PackageId;
pub use person_name::PersonName;
pub use refusal::Refusal;
pub use room_link::RoomLink;
pub use token::Token;
