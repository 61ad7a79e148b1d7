//! The errors of a call.

use crate::plan::Relay;
use crate::sdp::SdpError;
use identity::IdentityError;
use link_http::HttpError;
use link_protocol::limits::MAX_PEOPLE;
use link_protocol::{ProtocolError, Refusal};

/// An error of signaling, transport or transfer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CallError {
    /// A request to the server failed.
    #[error(transparent)]
    Http(#[from] HttpError),
    /// The WebRTC connection could not be made or used.
    #[error("the WebRTC connection failed")]
    WebRtc(#[from] webrtc::error::Error),
    /// The WebRTC library made no description of a connection.
    #[error("WebRTC made no description of the connection")]
    NoDescription,
    /// The server or the sender did not answer in time, or the connection ended before it was open.
    #[error("no connection could be made in time")]
    NotConnected,
    /// Offer and answer were exchanged, but no packets pass between the two sides.
    #[error("no connection could be made: {}", no_way(relay.as_ref()))]
    NoWay {
        /// The relay that this side had.
        relay: Option<Relay>,
    },
    /// The sender is not in its room.
    #[error("the sender is not in the room now")]
    SenderAbsent,
    /// The sender does not take this viewer.
    #[error("{}", refused(*.0))]
    Refused(Refusal),
    /// A viewer of a seat whose key sits in no seat of the call.
    #[error("it sits in no seat of the call, or shows no key")]
    NotSeated,
    /// The sender has as many viewers as it takes.
    #[error(
        "the sender has as many viewers as it serves, and its server forwards to no more of them (`serve --forward` says to how many)"
    )]
    TooManyViewers,
    /// As many guests have links as may.
    #[error(
        "{most} guests have links that hold: links end by themselves, or with their room, so give the next ones a shorter time or open another room"
    )]
    TooManyGuests {
        /// So many.
        most: usize,
    },
    /// No key was agreed on for what the server hands on.
    #[error(
        "no key could be agreed on for what the server hands on: the other side's program or the server's is too old, or the server or someone on the way changed what was said"
    )]
    NoExchange,
    /// The other side does not prove that it has the link.
    #[error(
        "the other side does not prove that it has the link: the server or someone on the way is in its place, its link was cut short, or its program is too old"
    )]
    NoLink,
    /// What a forwarder hands on was sealed at another time.
    #[error(
        "what the server hands on was sealed {apart} s from now by this machine's clock: either a clock is wrong, or it was recorded earlier"
    )]
    OldSeal {
        /// Seconds between.
        apart: u64,
    },
    /// The sender does not prove who it is, though the link tells its key or its avatar is signed.
    #[error(
        "the sender does not prove that it is who it should be: either its program is too old, or the server or someone on the way is in its place"
    )]
    NoKey,
    /// Another key than the link tells.
    #[error(
        "the sender has another key ({found}) than the link tells: someone else is in its place, or it has a new key and this link is old"
    )]
    WrongKey {
        /// The fingerprint of the sender's key.
        found: String,
    },
    /// Another sender than the one that this call was with.
    #[error(
        "someone else sends now (key {}) than before (key {}): join again if you mean to see them",
        named(found.as_deref()),
        named(before.as_deref())
    )]
    AnotherSender {
        /// The fingerprint of the first sender's key, if it showed one.
        before: Option<String>,
        /// That of the present sender's.
        found: Option<String>,
    },
    /// An avatar that is neither the driver's own nor permitted to them.
    #[error(
        "the avatar belongs to the key {owner}, which does not let the key {driver} drive it{}: its owner can, with `mon3tr keys allow`",
        why.as_ref().map(|why| format!(" ({why})")).unwrap_or_default()
    )]
    NotTheirAvatar {
        /// The fingerprint of the avatar's signer.
        owner: String,
        /// The fingerprint of the sender's key.
        driver: String,
        /// Why a permit of the owner's does not hold.
        why: Option<IdentityError>,
    },
    /// A key, a signature or a permit is wrong.
    #[error(
        "who the other side is cannot be told: {0}; someone on the way may have changed what it sent"
    )]
    Identity(#[from] IdentityError),
    /// An offer or answer cannot be read, or in more than one way.
    #[error(
        "what the other side says of its connection is refused ({0}): either its program does not follow docs/protocol.md, or the server or someone on the way changed it"
    )]
    Description(#[from] SdpError),
    /// Packets pass, but DTLS does not come about with the certificate that was signed.
    #[error(
        "packets pass between the two sides, but the other one does not show the certificate that it signed: the server or someone on the way may be between you, or its program has stopped; nothing was sent or shown"
    )]
    NoHandshake,
    /// The connection is with another certificate than the one that was signed.
    #[error(
        "the connection is with someone else than the one who signed its description: the server or someone on the way is between you; nothing was sent or shown"
    )]
    OtherCertificate,
    /// All seats of the call are taken.
    #[error("the call is full: it has {MAX_PEOPLE} seats, and all are taken")]
    Full,
    /// The system gave no random number for a session.
    #[error("the system gives no random numbers")]
    Random(#[from] getrandom::Error),
    /// A task panicked.
    #[error("a task of the call failed")]
    Task(#[from] tokio::task::JoinError),
}

/// Why a viewer is not taken, and what its user can do.
fn refused(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Link => {
            "the sender takes only those who have its whole link: was something at its end left out?"
        }
        Refusal::Full | Refusal::Many => "the sender has as many viewers as it serves",
        Refusal::Wait => "the other side is asked to let you in: wait",
        Refusal::Locked => "the room is locked for newcomers: ask the other side to unlock it",
        Refusal::Removed => "the other side has sent you away",
        Refusal::Guests => {
            "only guests come in, each by a link of their own: ask the other side for one"
        }
        Refusal::Expired => "your link has ended: ask the other side for another one",
        Refusal::Seat => {
            "only those who sit in the call see and hear the others: take a seat with `mon3tr call LINK`, by the call's own link"
        }
        Refusal::Nameless => {
            "the other side is asked about each viewer by their key, and you show none: mend your key (`mon3tr keys`)"
        }
    }
}

fn named(fingerprint: Option<&str>) -> &str {
    fingerprint.unwrap_or("none")
}

/// What was tried, and what to do.
fn no_way(relay: Option<&Relay>) -> String {
    match relay {
        Some(relay) => format!(
            "neither directly nor relayed by {relay}; is the other side's network up, and does it let packets through to that server?"
        ),
        None => "a NAT or firewall lets nothing through between sender and viewer, and the server offers no relay that answers; \
                 its operator can start it with --turn"
            .to_owned(),
    }
}

impl CallError {
    /// The answer to a side whose offer is not taken. Each offer is answered: one without an answer keeps a place at
    /// the server for seconds.
    pub(crate) fn refusal(&self) -> Refusal {
        match self {
            // Not the viewer's fault: it may try again.
            Self::TooManyViewers | Self::Random(_) => Refusal::Many,
            Self::Refused(refusal) => *refusal,
            _ => Refusal::Link,
        }
    }

    /// Whether the sender is not there, and may come.
    pub(crate) fn is_absence(&self) -> bool {
        matches!(
            self,
            Self::SenderAbsent | Self::Http(HttpError::SenderAbsent { .. })
        )
    }

    /// Whether trying again later cannot help, because the link itself is wrong, or the other side is not who it should be.
    #[must_use]
    pub fn is_final(&self) -> bool {
        match self {
            Self::Http(error) => error.is_final(),
            Self::Refused(refusal) => *refusal != Refusal::Wait,
            Self::NoLink
            | Self::NoKey
            | Self::NoExchange
            | Self::OldSeal { .. }
            | Self::WrongKey { .. }
            | Self::AnotherSender { .. }
            | Self::NotTheirAvatar { .. }
            | Self::Description(_)
            | Self::OtherCertificate
            | Self::Identity(_) => true,
            _ => false,
        }
    }

    /// Whether the room or package does not exist for this token.
    #[must_use]
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Http(HttpError::NotFound { .. }))
    }
}

impl From<ProtocolError> for CallError {
    fn from(error: ProtocolError) -> Self {
        Self::Http(error.into())
    }
}
