//! Which step of a call failed, and why.

use link_call::CallError;
use link_http::HttpError;
use serde::Serialize;
use std::error::Error;
use std::fmt;

/// The steps of a call, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Step {
    /// The server's name has an address.
    Dns,
    /// The server takes a connection and answers.
    Connection,
    /// Its certificate is trusted.
    Tls,
    /// It accepts the owner's token.
    Token,
    /// It has or takes the avatar's package.
    Store,
    /// It opens a room.
    Room,
    /// It lets a sender into the room.
    Presence,
    /// It passes on offer and answer.
    Offer,
    /// Sender and viewer connect (ICE, DTLS).
    Ice,
    /// The first frame of motion arrives.
    FirstFrame,
    /// So do the following ones.
    Frames,
    /// The relay lends an address.
    Relay,
    /// The server forwards to viewers beyond those that a sender serves.
    Forwarding,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Dns => "DNS",
            Self::Connection => "connection",
            Self::Tls => "TLS",
            Self::Token => "token",
            Self::Store => "store",
            Self::Room => "room",
            Self::Presence => "presence",
            Self::Offer => "offer",
            Self::Ice => "ICE",
            Self::FirstFrame => "first frame",
            Self::Frames => "frames",
            Self::Relay => "relay",
            Self::Forwarding => "forwarding",
        })
    }
}

/// A step that failed.
#[derive(Debug, thiserror::Error, Serialize)]
#[error("{step}: {why}")]
pub(super) struct Failure {
    pub(super) step: Step,
    pub(super) why: String,
}

impl Failure {
    pub(super) fn new(step: Step, why: impl Into<String>) -> Self {
        Self {
            step,
            why: why.into(),
        }
    }

    /// An error of a request that was made in `step`, which may have failed in an earlier one.
    pub(super) fn of_http(step: Step, error: &HttpError) -> Self {
        let step = match error {
            HttpError::Unreachable { source, .. } if chain(source).contains("dns error") => {
                Step::Dns
            }
            HttpError::Unreachable { .. } => Step::Connection,
            HttpError::Untrusted { .. } | HttpError::NoTls { .. } => Step::Tls,
            HttpError::Unauthorized { .. } => Step::Token,
            _ => step,
        };
        Self::new(step, error.to_string())
    }

    /// The same of an error of the call's.
    pub(super) fn of_call(step: Step, error: &CallError) -> Self {
        match error {
            CallError::Http(error) => Self::of_http(step, error),
            other => Self::new(step, other.to_string()),
        }
    }

    /// Of a viewer without a connection, by its last reason.
    pub(super) fn of_viewer(why: Option<String>) -> Self {
        // How `CallError` begins where offer and answer were exchanged.
        const NOT_CONNECTED: &str = "no connection could be made";
        match why {
            Some(why) if why.starts_with(NOT_CONNECTED) => Self::new(Step::Ice, why),
            Some(why) => Self::new(Step::Offer, why),
            None => Self::new(Step::Offer, "the server did not pass on the offer"),
        }
    }
}

/// An error with its causes.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text += &format!(": {cause}");
        next = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewer_without_a_path_failed_in_ice_and_one_without_an_answer_in_the_offer() {
        let step = |why: Option<CallError>| Failure::of_viewer(why.map(|why| why.to_string())).step;
        assert_eq!(step(Some(CallError::NotConnected)), Step::Ice);
        assert_eq!(step(Some(CallError::NoWay { relay: None })), Step::Ice);
        assert_eq!(step(Some(CallError::TooManyViewers)), Step::Offer);
        assert_eq!(step(None), Step::Offer);
    }
}
