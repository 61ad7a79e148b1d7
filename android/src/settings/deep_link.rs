//! The link that opens the app: a room's or a call's link with `mon3tr://room/` or `mon3tr://call/` before it and `/` for its `://`.
//!
//! ```text
//! https://call.example:8480/rooms/R7#TOKEN
//! mon3tr://room/https/call.example:8480/rooms/R7#TOKEN
//! https://call.example:8480/calls/C7#TOKEN
//! mon3tr://call/https/call.example:8480/calls/C7#TOKEN
//! ```
//!
//! The token stands behind the `#` here too, so it reaches no server's log. A link says one room or call on one server and nothing else, and
//! it is refused if a parser could read another server from it than a person does.

use super::room::{read_call_link, read_room_link};
use super::{Problem, plain};
use crate::settings::Origin;
use link_protocol::{CallLink, RoomLink};
use url::Url;

/// What a link to a room begins with.
pub const DEEP_LINK: &str = "mon3tr://room/";

/// What a link to a call begins with.
pub const DEEP_CALL_LINK: &str = "mon3tr://call/";

/// Where a link leads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Destination {
    /// A room, as a viewer.
    Room(RoomLink),
    /// A call of several, as a member.
    Call(CallLink),
}

/// The longest that is looked at.
const LONGEST: usize = 8_192;

/// Writes the link to this room or call, token and all.
#[must_use]
pub fn deep_link(destination: &Destination) -> String {
    let (beginning, link) = match destination {
        Destination::Room(room) => (DEEP_LINK, room.to_string()),
        Destination::Call(call) => (DEEP_CALL_LINK, call.to_string()),
    };
    format!("{beginning}{}", link.replacen("://", "/", 1))
}

/// The room or call that a link names.
///
/// # Errors
/// [`Problem::Unreadable`], in one line without the token.
pub fn read_deep_link(text: &str) -> Result<Destination, Problem> {
    read(text).map_err(|why| Problem::Unreadable {
        origin: Origin::Link,
        why,
    })
}

fn read(text: &str) -> Result<Destination, String> {
    plain::check(text, LONGEST)?;
    let url = Url::parse(text).map_err(|error| format!("it is no link: {error}"))?;
    if url.scheme() != "mon3tr" {
        return Err(format!(
            "it must begin with mon3tr:, not {}:",
            plain::repeated(url.scheme()).trim_matches('`')
        ));
    }
    if !url.username().is_empty() || url.password().is_some() || url.port().is_some() {
        return Err(format!(
            "nothing may stand beside `room` or `call`, no user name, password or port: it must begin with {DEEP_LINK} or {DEEP_CALL_LINK}"
        ));
    }
    let host = url.host_str().unwrap_or_default();
    let beginning = match host {
        "room" => DEEP_LINK,
        "call" => DEEP_CALL_LINK,
        _ => {
            return Err(format!(
                "it must begin with {DEEP_LINK} or {DEEP_CALL_LINK}, not with mon3tr://{}",
                plain::repeated(host).trim_matches('`')
            ));
        }
    };
    if url.query().is_some() {
        return Err("it must not have a `?`".to_owned());
    }
    // What one parser corrects (dots, blanks, slashes) another may correct differently.
    let rest = (url.as_str() == text)
        .then(|| text.strip_prefix(beginning))
        .flatten()
        .ok_or("it is not written as links are: are there dots, blanks or backslashes too many?")?;
    let (scheme, place) = rest
        .split_once('/')
        .filter(|(scheme, _)| matches!(*scheme, "http" | "https"))
        .ok_or_else(|| {
            format!("after {beginning} must come https/ or http/, then the link's own host")
        })?;
    let link = format!("{scheme}://{place}");
    if beginning == DEEP_CALL_LINK {
        read_call_link(&link).map(Destination::Call)
    } else {
        read_room_link(&link).map(Destination::Room)
    }
}
