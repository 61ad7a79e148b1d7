//! The STUN and TURN servers that a room's bearers are told: those of others that the operator named, and this server's own, with
//! credentials for the room.

use crate::token::{Claims, Role, now, turn_key};
use crate::{Config, Id, ServerError, turn};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, header};
use link_protocol::IceServers;
use link_protocol::ice::{IceKind, IceServer, IceUrl};
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::sync::{Arc, Weak};
use std::time::Duration;
use turn_server::credentials as relay;
use turn_server::{Admission, Key, TurnServer};

/// How long a credential allows new relays. A relay that a call uses lives on.
const CREDENTIAL_LIFETIME: Duration = Duration::from_secs(3600);
/// How often a sender is told anew: well before its credential ends.
pub(crate) const TELL_ICE_EVERY: Duration = Duration::from_secs(1800);

/// What bearers are told.
#[derive(Debug)]
pub(crate) struct Ice {
    stun: Vec<String>,
    own: Option<Own>,
}

/// This server's own relay.
#[derive(Debug)]
struct Own {
    /// By which it is reached, as far as it is known here.
    host: Option<String>,
    /// That is its name for callers, too: it is on another host than the signaling.
    is_elsewhere: bool,
    port: u16,
    key: Key,
    tls: bool,
    server: Weak<TurnServer>,
}

impl Ice {
    /// Starts the relay, if there should be one.
    pub(crate) fn start(
        config: &Config,
        admission: Arc<dyn Admission>,
        #[cfg(feature = "tls")] tls: Option<Arc<rustls::ServerConfig>>,
    ) -> Result<(Self, Option<Arc<TurnServer>>), ServerError> {
        let stun = config.stun.iter().map(ToString::to_string).collect();
        let key = turn_key(&config.secret);
        #[cfg(not(feature = "tls"))]
        let has_tls = false;
        #[cfg(feature = "tls")]
        let has_tls = tls.is_some();
        if let Some(at) = &config.turn_at {
            let own = Some(Own {
                host: at.host.clone().or_else(this_machine),
                is_elsewhere: at.host.is_some(),
                port: at.port,
                key,
                tls: has_tls,
                server: Weak::new(),
            });
            return Ok((Self { stun, own }, None));
        }
        let Some(turn) = &config.turn else {
            return Ok((Self { stun, own: None }, None));
        };
        let server = Arc::new(turn::start(
            key.clone(),
            turn,
            admission,
            #[cfg(feature = "tls")]
            tls,
        )?);
        let named = turn.external.or(Some(turn.listen.ip()));
        let host = named
            .filter(|ip| !ip.is_unspecified())
            .map(|ip| ip.to_string())
            .or_else(this_machine);
        let own = Some(Own {
            host,
            is_elsewhere: false,
            port: server.address().port(),
            key,
            tls: has_tls,
            server: Arc::downgrade(&server),
        });
        Ok((Self { stun, own }, Some(server)))
    }

    /// Whether there is any server to tell.
    pub(crate) fn has_any(&self) -> bool {
        self.own.is_some() || !self.stun.is_empty()
    }

    /// This server's own relay, if it has one.
    pub(crate) fn relay(&self) -> Option<Arc<TurnServer>> {
        self.own.as_ref()?.server.upgrade()
    }

    /// What the bearer of a token is told of a room. This server's own relay has the name by which the bearer reached
    /// this server, from the request's headers: a bearer that sends a false name changes only its own answer.
    pub(crate) fn servers(&self, headers: &HeaderMap, claims: &Claims) -> IceServers {
        let role = match claims.role {
            Role::Sender => relay::Role::Sender,
            Role::Member => relay::Role::Member,
            Role::Viewer | Role::Owner => relay::Role::Viewer,
        };
        // Of a member the call, not a seat: relays are counted by it, and a member can ask about each seat.
        self.servers_at(self.host(headers), claims.room(), role, Some(claims))
    }

    /// The name or address by which the bearer reaches the relay: its own name, or that of this server in the request's headers.
    fn host(&self, headers: &HeaderMap) -> Option<String> {
        let elsewhere = self.own.as_ref().filter(|own| own.is_elsewhere);
        elsewhere.map_or_else(|| host(headers), |own| own.host.clone())
    }

    /// What this server's own forwarder uses: nothing of what clients say.
    pub(crate) fn own_servers(&self, room: Id) -> IceServers {
        let host = self.own.as_ref().and_then(|own| own.host.clone());
        self.servers_at(host, room, relay::Role::Sender, None)
    }

    fn servers_at(
        &self,
        host: Option<String>,
        room: Id,
        role: relay::Role,
        claims: Option<&Claims>,
    ) -> IceServers {
        let mut servers = Vec::new();
        if !self.stun.is_empty() {
            servers.push(IceServer {
                urls: self.stun.clone(),
                username: None,
                credential: None,
            });
        }
        if let Some(own) = &self.own
            && let Some(host) = host
        {
            let url = |kind| {
                IceUrl {
                    kind,
                    host: host.clone(),
                    port: own.port,
                }
                .to_string()
            };
            servers.push(IceServer {
                urls: vec![url(IceKind::Stun)],
                username: None,
                credential: None,
            });
            let mut urls = vec![url(IceKind::TurnUdp), url(IceKind::TurnTcp)];
            if own.tls {
                urls.push(url(IceKind::TurnTls));
            }
            let expires = claims.map_or(u64::MAX, |claims| claims.expires);
            let expires = expires.min(now().saturating_add(CREDENTIAL_LIFETIME.as_secs()));
            let names = claims.map(|claims| claims.names().map(|name| name.to_string()));
            let tokens =
                names.map_or_else(String::new, |names| names.collect::<Vec<_>>().join("."));
            let owner = claims.map_or_else(String::new, |claims| claims.owner.to_string());
            let subject = relay::Subject {
                room: &room.to_string(),
                role,
                tokens: &tokens,
                owner: &owner,
            };
            let issued = own.key.issue(&subject.to_string(), expires);
            servers.push(IceServer {
                urls,
                username: Some(issued.username),
                credential: Some(issued.password),
            });
        }
        IceServers::try_from(servers).unwrap_or_else(|error| {
            // A name of the bearer's own making may be too long.
            log::debug!("a sender or viewer is told no STUN and TURN servers: {error}");
            IceServers::default()
        })
    }
}

/// This machine's address for others.
fn this_machine() -> Option<String> {
    own_address(Ipv4Addr::UNSPECIFIED.into()).map(|ip| ip.to_string())
}

/// The address that packets to the world leave from, of those that `any` stands for. Nothing is sent: connecting a UDP socket only chooses it. 192.0.2.1 is
/// reserved for documentation.
#[must_use]
pub fn own_address(any: IpAddr) -> Option<IpAddr> {
    let socket = UdpSocket::bind((any, 0)).ok()?;
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

/// The name or address by which a request came, an IPv6 address without brackets.
fn host(headers: &HeaderMap) -> Option<String> {
    let host: Authority = headers.get(header::HOST)?.to_str().ok()?.parse().ok()?;
    Some(host.host().trim_matches(['[', ']']).to_owned())
}
