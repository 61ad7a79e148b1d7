//! What crosses the network in a call: motion frames and the messages around them (`docs/protocol.md`), the WebRTC data channel
//! they take, and HTTP to the server for signaling and packages. Knows bytes and time; draws nothing.

mod call;
mod clock;
pub mod codec;
mod error;
mod frame;
mod http;
mod playout;

pub use call::{CallEvent, Host, HostStatistics, Viewer, ViewerStatistics};
pub use clock::{Clock, ClockOffset, Exchange, ExchangeError};
pub use codec::{Codec, Decoder, Encoder, Refusal, RefusalCounts};
pub use error::LinkError;
pub use frame::{Micros, MotionFrame};
pub use http::{
    Announcement, Answer, AvatarRef, ChannelMode, Client, HttpError, MAX_PACKAGE_BYTES,
    PackageCache, PackageId, PackageInUse, Patience, Presence, PresenceEvent, Progress, Room,
    RoomLink, ServerUrl,
};
pub use playout::{Arrival, JitterBuffer, Played, PlayoutStatistics, Timing};
