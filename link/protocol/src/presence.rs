//! The events of a sender's presence stream.

use crate::{IceServers, Name};
use serde::Deserialize;
use serde_json::json;
use std::fmt;

/// An event from the server to the sender in a room. On the wire it is a server-sent event: a name and JSON.
#[derive(Clone, PartialEq, Eq)]
pub enum PresenceEvent {
    /// A viewer offers a connection and waits for the answer.
    Offer {
        /// The session's name on the server.
        session: Name,
        /// The viewer's SDP, with all its candidates.
        sdp: String,
        /// The server's own forwarder offers this, to hand on to others what it gets. It has no link, so it cannot prove that it has.
        forwards: bool,
        /// What the server calls the viewer's token; nothing of its own forwarder and of the people of a call.
        token: Option<Name>,
        /// What the server calls the network that the offer came from: the same for offers of one IPv4 address or one
        /// IPv6 /56 to one room.
        network: Option<Name>,
    },
    /// A viewer has left.
    Leave {
        /// The session's name on the server.
        session: Name,
    },
    /// The STUN and TURN servers to use from now on.
    IceServers(IceServers),
    /// The server forwards: viewers that are refused because there are many are served nevertheless.
    Forwards,
    /// Another sender has entered with the same token. It is the last event.
    Replaced,
}

#[derive(Deserialize)]
struct IceData {
    ice_servers: IceServers,
}

#[derive(Deserialize)]
struct OfferData {
    session: Name,
    sdp: String,
    #[serde(default)]
    forwards: bool,
    #[serde(default)]
    token: Option<Name>,
    #[serde(default)]
    network: Option<Name>,
}

#[derive(Deserialize)]
struct LeaveData {
    session: Name,
}

impl PresenceEvent {
    /// The event of this name with this data; nothing for a name of a later version.
    ///
    /// # Errors
    /// If the data is not what the name asks for.
    pub fn read(name: &str, data: &str) -> Result<Option<Self>, serde_json::Error> {
        Ok(Some(match name {
            "offer" => {
                let offer: OfferData = serde_json::from_str(data)?;
                Self::Offer {
                    session: offer.session,
                    sdp: offer.sdp,
                    forwards: offer.forwards,
                    token: offer.token,
                    network: offer.network,
                }
            }
            "leave" => {
                let LeaveData { session } = serde_json::from_str(data)?;
                Self::Leave { session }
            }
            "ice" => {
                let IceData { ice_servers } = serde_json::from_str(data)?;
                Self::IceServers(ice_servers)
            }
            "forwards" => Self::Forwards,
            "replaced" => Self::Replaced,
            _ => return Ok(None),
        }))
    }

    /// The event's name and its data.
    #[must_use]
    pub fn write(&self) -> (&'static str, String) {
        let (name, data) = match self {
            Self::Offer {
                session,
                sdp,
                forwards,
                token,
                network,
            } => {
                let mut offer = json!({ "session": session, "sdp": sdp });
                if let Some(token) = token {
                    offer["token"] = token.as_str().into();
                }
                if let Some(network) = network {
                    offer["network"] = network.as_str().into();
                }
                if *forwards {
                    offer["forwards"] = true.into();
                }
                ("offer", offer)
            }
            Self::Leave { session } => ("leave", json!({ "session": session })),
            Self::IceServers(servers) => ("ice", json!({ "ice_servers": servers })),
            Self::Forwards => ("forwards", json!({})),
            Self::Replaced => ("replaced", json!({})),
        };
        (name, data.to_string())
    }
}

// An SDP holds addresses and a password.
impl fmt::Debug for PresenceEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Offer { session, .. } => f
                .debug_struct("Offer")
                .field("session", session)
                .finish_non_exhaustive(),
            Self::Leave { session } => f.debug_struct("Leave").field("session", session).finish(),
            Self::IceServers(servers) => f.debug_tuple("IceServers").field(servers).finish(),
            Self::Forwards => f.write_str("Forwards"),
            Self::Replaced => f.write_str("Replaced"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_written_by_the_protocol_and_read_back() {
        let session: Name = "S1".parse().expect("a name");
        let offer = PresenceEvent::Offer {
            session: session.clone(),
            sdp: "v=0\r\n".to_owned(),
            forwards: false,
            token: Some("T1".parse().expect("a name")),
            network: Some("N1".parse().expect("a name")),
        };
        let forwarders = PresenceEvent::Offer {
            session: session.clone(),
            sdp: "v=0\r\n".to_owned(),
            forwards: true,
            token: None,
            network: None,
        };
        let written = [
            (
                offer,
                "offer",
                r#"{"network":"N1","sdp":"v=0\r\n","session":"S1","token":"T1"}"#,
            ),
            (
                forwarders,
                "offer",
                r#"{"forwards":true,"sdp":"v=0\r\n","session":"S1"}"#,
            ),
            (
                PresenceEvent::Leave { session },
                "leave",
                r#"{"session":"S1"}"#,
            ),
            (
                PresenceEvent::IceServers(
                    serde_json::from_str(r#"[{"urls":["stun:a"]}]"#).expect("servers"),
                ),
                "ice",
                r#"{"ice_servers":[{"urls":["stun:a"]}]}"#,
            ),
            (PresenceEvent::Forwards, "forwards", "{}"),
            (PresenceEvent::Replaced, "replaced", "{}"),
        ];
        for (event, name, data) in written {
            assert_eq!(event.write(), (name, data.to_owned()), "{event:?}");
            let read = PresenceEvent::read(name, data).expect("as it was written");
            assert_eq!(read, Some(event), "{name}");
        }
        let later = PresenceEvent::read("later", "1").expect("nothing is read");
        assert_eq!(later, None, "a later version's");
        for (name, data) in [
            ("offer", r#"{"session":"S1"}"#),
            ("leave", r#"{"session":"../S1"}"#),
            ("leave", "nonsense"),
            ("ice", r#"{"ice_servers":[{}]}"#),
        ] {
            assert!(PresenceEvent::read(name, data).is_err(), "{name} {data}");
        }
    }
}
