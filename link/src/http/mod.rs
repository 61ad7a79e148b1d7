//! The HTTP side of a call, as a sender and a viewer see it (`docs/protocol.md`): rooms and their links, the sender's presence,
//! one offer and one answer, and avatar packages with their cache. It opens no WebRTC connection and reads no package: an SDP is
//! text here, a package is bytes with a hash.

mod announcement;
mod cache;
mod client;
mod error;
mod fetch;
mod file_lock;
mod package_id;
mod part;
mod presence;
mod room_link;
mod rooms;
mod roots;
mod sse;
mod upload;

pub use announcement::{Announcement, AvatarRef, ChannelMode, MAX_PACKAGE_BYTES};
pub use cache::{PackageCache, PackageInUse};
pub use client::{Client, Patience};
pub use error::HttpError;
pub use fetch::Progress;
pub use package_id::PackageId;
pub use presence::{Presence, PresenceEvent};
pub use room_link::{RoomLink, ServerUrl};
pub use rooms::{Answer, Room};
