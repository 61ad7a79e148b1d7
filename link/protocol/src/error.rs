//! Why a text or a value is not one of the protocol's, with what to do about it. No message holds a token.

use crate::limits::MAX_PERSON_NAME;
use std::io;
use std::path::PathBuf;

/// What is wrong with a text or a value that should be one of the protocol's.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// This text is no room link.
    #[error(
        "this is no room link: {0}; a link looks like https://HOST[:PORT]/rooms/ROOM#TOKEN, in quotes on a command line"
    )]
    Link(String),
    /// This text is no link of a call.
    #[error(
        "this is no call's link: {0}; one looks like https://HOST[:PORT]/calls/CALL#TOKEN, in quotes on a command line"
    )]
    CallLink(String),
    /// This text is no server's address.
    #[error("this is no server's address: {0}; an address looks like https://HOST[:PORT]")]
    Address(String),
    /// This text cannot be a token.
    #[error("this is no token: {0}; copy it once more from where the server printed it")]
    Token(&'static str),
    /// This text is no package's hash.
    #[error("this is no package's hash: it must be 64 hexadecimal digits in lower case")]
    PackageId,
    /// This text is no room's or session's name.
    #[error("this is no name of a room or a session: it must be 1 to 128 letters, digits and -._~")]
    Name,
    /// This text is no person's name.
    #[error(
        "this is no person's name: it must be 1 to {MAX_PERSON_NAME} characters on one line, without control characters"
    )]
    PersonName,
    /// An announcement has a value out of bounds.
    #[error("this announcement is out of bounds: {0}")]
    Announcement(String),
    /// A room's STUN and TURN servers are out of bounds.
    #[error("the room has too many STUN and TURN servers, or one with too long an address")]
    IceServers,
    /// This text is no address of a STUN or TURN server.
    #[error(
        "this is no address of a STUN or TURN server: {0}; one looks like stun:HOST[:PORT] or turn:HOST[:PORT]?transport=udp"
    )]
    IceUrl(String),
    /// This word is no channel mode.
    #[error("there is no channel `{0}`: choose unreliable or reliable")]
    ChannelMode(String),
    /// A package file that should be sent cannot be read.
    #[error("cannot read package {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}
