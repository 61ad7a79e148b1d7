//! Servers, rooms and calls, taken exactly as they are named: an address that a parser would understand as another one (`0x7f.1`,
//! `host/../x`, `%68ost`) is refused with the address it would become.

use super::plain;
use link_protocol::room_link::ServerUrl;
use link_protocol::{CallLink, ProtocolError, RoomLink};
use std::str::FromStr;

/// The longest address that is looked at; links have a token besides.
const LONGEST: usize = 8_192;

/// A whole `https://HOST/rooms/ROOM#TOKEN`.
pub(super) fn read_room_link(text: &str) -> Result<RoomLink, String> {
    read_link(text, "/rooms/", RoomLink::server)
}

/// A whole `https://HOST/calls/CALL#TOKEN`.
pub(super) fn read_call_link(text: &str) -> Result<CallLink, String> {
    read_link(text, "/calls/", CallLink::server)
}

/// A link to what `place` stands before.
fn read_link<L: FromStr<Err = ProtocolError>>(
    text: &str,
    place: &str,
    server_of: impl Fn(&L) -> &ServerUrl,
) -> Result<L, String> {
    plain::check(text, LONGEST)?;
    // A token may have slashes too.
    let address = text.split('#').next().unwrap_or_default();
    check_address(address)?;
    let link: L = text.parse().map_err(|error| line(&error))?;
    let server = address.rsplit_once(place).map_or("", |(server, _)| server);
    check_named(server, server_of(&link))?;
    Ok(link)
}

/// A server's address.
pub(super) fn read_server(text: &str) -> Result<ServerUrl, String> {
    plain::check(text, LONGEST)?;
    check_address(text)?;
    let server: ServerUrl = text.parse().map_err(|error| line(&error))?;
    check_named(text, &server)?;
    Ok(server)
}

fn check_address(text: &str) -> Result<(), String> {
    match text.bytes().find(|byte| b" %\\@?\"<>^`{|}".contains(byte)) {
        Some(b'@') => {
            Err("it must not hold a user name or password (there is an `@` in it)".to_owned())
        }
        Some(b'%') => Err("no part of it may be percent-encoded".to_owned()),
        Some(byte) => Err(format!(
            "it has a character that no address has: {:?}",
            char::from(byte)
        )),
        None => Ok(()),
    }
}

/// Refuses an address that its parser understood as another one. A host's case, a scheme's own port and slashes at the end are no
/// difference.
fn check_named(text: &str, server: &ServerUrl) -> Result<(), String> {
    let understood = server.to_string();
    let named = || {
        let (scheme, rest) = text.split_once("://")?;
        let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        let (scheme, host) = (scheme.to_ascii_lowercase(), host.to_ascii_lowercase());
        let own_port = if scheme == "https" { ":443" } else { ":80" };
        let host = host.strip_suffix(own_port).unwrap_or(&host);
        Some(format!("{scheme}://{host}{}", path.trim_end_matches('/')))
    };
    if named().as_deref() == Some(&understood) {
        return Ok(());
    }
    Err(format!(
        "its address would be understood as {}: write that if it is meant",
        plain::repeated(&understood).trim_matches('`')
    ))
}

/// What is wrong with a link, an address or a token, on one line.
pub(super) fn line(error: &ProtocolError) -> String {
    plain::one_line(&error.to_string())
}
