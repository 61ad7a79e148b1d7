//! The HTTP side of a call, as a sender and a viewer see it (`docs/protocol.md`): rooms, the sender's presence, one offer and one
//! answer, and avatar packages with their cache. It opens no WebRTC connection and reads no package: an SDP is text here, a package
//! is bytes with a hash.

pub mod cache;
pub mod client;
mod error;
pub mod fetch;
mod file_lock;
mod part;
pub mod presence;
pub mod rooms;
mod roots;
mod sse;
mod upload;

pub use cache::PackageCache;
pub use client::Client;
pub use error::HttpError;
