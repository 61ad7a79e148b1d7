//! The HTTP side of a call, as a sender and a viewer see it (`docs/protocol.md`): rooms, the sender's presence, one offer and one
//! answer, and avatar packages with their cache. It opens no WebRTC connection and reads no package: an SDP is text here, a package
//! is bytes with a hash.
//!
//! ```no_run
//! use link_http::{Client, PackageCache};
//! use link_protocol::RoomLink;
//!
//! # async fn fetch() -> Result<(), Box<dyn std::error::Error>> {
//! let client = Client::new(None)?;
//! let room: RoomLink = "https://call.example/rooms/r7#TOKEN".parse()?;
//! let Some(announcement) = client.announcement(&room).await? else {
//!     return Err("the sender is absent".into());
//! };
//! let cache = PackageCache::new("/var/cache/mon3tr")?;
//! let report = |progress: link_http::download::Progress| {
//!     println!("{} of {} bytes", progress.done, progress.total);
//! };
//! let path = client.fetch_package(&room, &announcement.avatar, &cache, report).await?;
//! println!("the avatar is in {}", path.display());
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod cache;
mod calls;
pub mod client;
pub mod download;
mod error;
mod file_lock;
mod pace;
mod part;
pub mod presence;
pub mod rooms;
mod roots;
mod sse;
mod upload;

pub use cache::PackageCache;
pub use client::Client;
pub use error::HttpError;
