//! The bounds that the programs of a call keep, each written once for both ends.

use std::ops::RangeInclusive;
use std::time::Duration;

/// The largest avatar package, in bytes: what an announcement may make a viewer store. A server may allow less.
pub const MAX_PACKAGE_BYTES: u64 = 1 << 30;

/// The largest body of a request that is neither SDP nor a package, in bytes.
pub const MAX_JSON_BYTES: usize = 4 << 10;

/// The largest SDP that a server takes by default, in bytes; a few KB are usual.
pub const MAX_SDP_BYTES: usize = 64 << 10;

/// The largest message on a data channel, in bytes; larger ones are dropped unread.
pub const MAX_MESSAGE_BYTES: usize = 4 << 10;

/// Characters of a room's or a session's name.
pub const MAX_NAME: usize = 128;

/// Characters of a person's name.
pub const MAX_PERSON_NAME: usize = 40;

/// People in one call.
pub const MAX_PEOPLE: usize = 8;

/// Seats of one call that one network address may take where the call's opener allows no more; of IPv6, one /56.
pub const SEATS_PER_ADDRESS: u8 = 3;

/// How long the server keeps a seat for its occupant after the occupant's presence stream has broken.
pub const SEAT_KEPT: Duration = Duration::from_secs(10);

/// Characters of a member's proof ([`MemberProof`](crate::calls::MemberProof)).
pub const MAX_MEMBER_PROOF: usize = 512;

/// Characters of a token.
pub const MAX_TOKEN: usize = 4096;

/// Characters of a room link: an address, a token, and what follows it.
pub const MAX_LINK: usize = 8192;

/// Characters of a server's address as it is written, with each character of its host or path that no address has encoded by several.
pub const MAX_ADDRESS: usize = 2048;

/// STUN and TURN servers of a room, addresses of one, and bytes of an address, a user's name or a credential.
pub const MAX_ICE_SERVERS: usize = 8;
/// See [`MAX_ICE_SERVERS`].
pub const MAX_ICE_URLS: usize = 8;
/// See [`MAX_ICE_SERVERS`].
pub const MAX_ICE_TEXT: usize = 512;

/// Motion frames a second.
pub const FRAME_RATE_HZ: RangeInclusive<f64> = 1.0..=240.0;

/// How long a room's tokens are valid where the owner asks for no lifetime.
pub const DEFAULT_ROOM_LIFETIME: Duration = Duration::from_secs(86_400);

/// How long the sender may take to answer an offer.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// The longest time between two lines of a presence stream: a server writes a comment where there is no event.
pub const PRESENCE_COMMENT_EVERY: Duration = Duration::from_secs(5);

/// Tokens of viewers that a sender revokes in one room.
pub const MAX_REVOKED: usize = 64;
