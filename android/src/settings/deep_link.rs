//! The link that opens the app: a room link with `mon3tr://room/` before it and `/` for its `://`.
//!
//! ```text
//! https://call.example:8480/rooms/R7#TOKEN
//! mon3tr://room/https/call.example:8480/rooms/R7#TOKEN
//! ```
//!
//! The token stands behind the `#` here too, so it reaches no server's log. A link says one room on one server and nothing else, and
//! it is refused if a parser could read another server from it than a person does.

use super::room::read_room_link;
use super::{Problem, plain};
use crate::settings::Origin;
use link_protocol::RoomLink;
use url::Url;

/// What every such link begins with.
pub const DEEP_LINK: &str = "mon3tr://room/";

/// The longest that is looked at.
const LONGEST: usize = 8_192;

/// Writes the link to this room, token and all.
#[must_use]
pub fn deep_link(room: &RoomLink) -> String {
    format!("{DEEP_LINK}{}", room.to_string().replacen("://", "/", 1))
}

/// The room that a link names.
///
/// # Errors
/// [`Problem::Unreadable`], in one line without the token.
pub fn read_deep_link(text: &str) -> Result<RoomLink, Problem> {
    read(text).map_err(|why| Problem::Unreadable {
        origin: Origin::Link,
        why,
    })
}

fn read(text: &str) -> Result<RoomLink, String> {
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
            "nothing may stand beside `room`, no user name, password or port: it must begin with {DEEP_LINK}"
        ));
    }
    let host = url.host_str().unwrap_or_default();
    if host != "room" {
        return Err(format!(
            "it must begin with {DEEP_LINK}, not with mon3tr://{}",
            plain::repeated(host).trim_matches('`')
        ));
    }
    if url.query().is_some() {
        return Err("it must not have a `?`".to_owned());
    }
    // What one parser corrects (dots, blanks, slashes) another may correct differently.
    let rest = (url.as_str() == text)
        .then(|| text.strip_prefix(DEEP_LINK))
        .flatten()
        .ok_or("it is not written as links are: are there dots, blanks or backslashes too many?")?;
    let (scheme, place) = rest
        .split_once('/')
        .filter(|(scheme, _)| matches!(*scheme, "http" | "https"))
        .ok_or_else(|| {
            format!("after {DEEP_LINK} must come https/ or http/, then the room link's own host")
        })?;
    read_room_link(&format!("{scheme}://{place}"))
}
