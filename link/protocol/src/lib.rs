//! What the programs of a call say to each other (`docs/protocol.md`), as types that the server, senders and viewers share: the
//! announcement, packages by hash, rooms' links and the messages beside motion frames. It opens no connection; the motion frames are
//! the codec's.

pub mod announcement;
mod error;
pub mod message;
pub mod package_id;
pub mod room_link;

pub use announcement::Announcement;
pub use error::ProtocolError;
pub use package_id::PackageId;
pub use room_link::RoomLink;
