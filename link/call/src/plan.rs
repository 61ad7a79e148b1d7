//! How a connection is to find its way: the addresses to bind, and those of the room's STUN and TURN servers that answer from here. A
//! server is asked once, not for every connection, and again after this machine's addresses have changed.

use crate::addresses;
use crate::scope::{Scope, resolve};
use crate::tunnel::Tunnel;
use link_protocol::IceServers;
use link_protocol::ice::{IceKind, IceServer, IceUrl};
use link_protocol::room_link::ServerUrl;
use rtc::stun::message::{
    BINDING_REQUEST, BINDING_SUCCESS, Getter, Message, TransactionId, is_stun_message,
};
use rtc::stun::xoraddr::XorMappedAddress;
use serde::Serialize;
use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::UdpSocket;
use tokio::sync::Mutex;
use tokio::task::JoinSet;
use tokio::time::{Instant, timeout};

/// When a server is asked, after the first time, and when it counts as unreachable over UDP.
const ASK_AGAIN: [Duration; 2] = [Duration::from_millis(200), Duration::from_millis(400)];
pub(crate) const UNREACHABLE: Duration = Duration::from_millis(900);
/// Servers that are asked over UDP, by host and port: an operator's own, and a few others.
const MOST_PLACES: usize = 8;
/// How long a server's other address is waited for after one has answered.
const OTHER_ADDRESS: Duration = Duration::from_millis(100);
/// How long what was found holds: a server that was restarted, or a network that lets more through, is noticed after this.
const HOLDS: Duration = Duration::from_secs(60);

/// The same of a look-up that found nothing.
const NOT_FOUND_HOLDS: Duration = Duration::from_secs(10);

/// What a relay is reached over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RelayTransport {
    /// UDP.
    Udp,
    /// TCP, because the network lets no UDP through to it.
    Tcp,
}

impl fmt::Display for RelayTransport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Udp => "UDP",
            Self::Tcp => "TCP",
        })
    }
}

/// The relay that a connection may use.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Relay {
    /// Its host's name or address.
    pub host: String,
    /// Its port.
    pub port: u16,
    /// How it is reached.
    pub transport: RelayTransport,
}

impl fmt::Display for Relay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} over {}", self.host, self.transport)
    }
}

/// A connection's way to be found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plan {
    /// The addresses to bind.
    pub(crate) local: Vec<SocketAddr>,
    /// The servers to ask, all over UDP.
    pub(crate) servers: Vec<IceServer>,
    /// The relay among them.
    pub(crate) relay: Option<Relay>,
}

/// Makes plans. Clones share what was found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Planner(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// This machine's addresses when it was found.
    here: BTreeSet<IpAddr>,
    /// Which addresses of a server answer, by its host and port.
    answers: HashMap<(String, u16), (Vec<SocketAddr>, Instant)>,
    /// How near the servers are that the room's server may name, and until when that holds.
    nearest: Option<(ServerUrl, Scope, Instant)>,
    tunnels: HashMap<(String, u16), Tunnel>,
}

impl Planner {
    /// The plan for a room on `server`, whose servers are `servers`.
    pub(crate) async fn plan(&self, server: &ServerUrl, servers: &IceServers) -> Plan {
        let mut plan = Plan {
            local: addresses::to_bind(server),
            ..Plan::default()
        };
        // Connections that are made at the same time wait for one finding.
        let mut known = self.0.lock().await;
        let nearest = known.nearest(server).await;
        known.ask(servers, nearest).await;
        for server in servers.as_slice() {
            known.add(&mut plan, server, nearest).await;
        }
        plan
    }
}

impl Known {
    /// How near the addresses are that this server may name.
    async fn nearest(&mut self, server: &ServerUrl) -> Scope {
        match &self.nearest {
            Some((known, scope, until)) if known == server && Instant::now() < *until => *scope,
            _ => {
                let (scope, holds) = match Scope::of_server(server).await {
                    Some(scope) => (scope, HOLDS),
                    // One that is found only by a proxy is on the internet.
                    None => (Scope::Internet, NOT_FOUND_HOLDS),
                };
                self.nearest = Some((server.clone(), scope, Instant::now() + holds));
                scope
            }
        }
    }

    /// Finds out which of the servers answer over UDP.
    async fn ask(&mut self, servers: &IceServers, nearest: Scope) {
        let here = addresses::usable();
        if here != self.here {
            self.answers.clear();
            self.tunnels.clear();
            self.nearest = None;
            self.here = here;
        }
        self.answers.retain(|_, (_, since)| since.elapsed() < HOLDS);
        let mut asked = JoinSet::new();
        let urls = servers.as_slice().iter().flat_map(IceServer::addresses);
        let mut places: Vec<(String, u16)> = Vec::new();
        for url in urls.filter(is_over_udp) {
            let place = (url.host, url.port);
            if places.len() < MOST_PLACES && !places.contains(&place) {
                places.push(place);
            }
        }
        places.retain(|place| !self.answers.contains_key(place));
        for place in places {
            asked.spawn(async move {
                let answers = answers(&place.0, place.1, nearest).await;
                (place, answers)
            });
        }
        while let Some(found) = asked.join_next().await {
            if let Ok((place, answers)) = found {
                if answers.is_empty() {
                    log::info!(
                        "{}:{} does not answer over UDP, or is nearer than the server which names it",
                        place.0,
                        place.1
                    );
                }
                self.answers.insert(place, (answers, Instant::now()));
            }
        }
    }

    /// Adds what is of use of a server: over UDP where it answers, else its relay over TCP.
    async fn add(&mut self, plan: &mut Plan, server: &IceServer, nearest: Scope) {
        let mut urls = Vec::new();
        for url in server.addresses().filter(is_over_udp) {
            let place = (url.host.clone(), url.port);
            let answers = self.answers.get(&place).map(|(answers, _)| answers.iter());
            for address in answers.into_iter().flatten() {
                if url.kind == IceKind::TurnUdp && plan.relay.is_none() {
                    plan.relay = Some(relay(&url, RelayTransport::Udp));
                }
                // The address that was checked: the library would look up the name once more.
                let host = address.ip().to_string();
                urls.push(
                    IceUrl {
                        host,
                        ..url.clone()
                    }
                    .to_string(),
                );
            }
        }
        let over_tcp = server.addresses().find(|url| url.kind == IceKind::TurnTcp);
        if let Some(url) = over_tcp
            && plan.relay.is_none()
        {
            match self.tunnel(&url, nearest).await {
                Ok(address) => {
                    urls.push(format!("turn:{address}?transport=udp"));
                    plan.relay = Some(relay(&url, RelayTransport::Tcp));
                }
                Err(error) => log::warn!("the relay {url} cannot be used: {error}"),
            }
        }
        if !urls.is_empty() {
            plan.servers.push(IceServer {
                urls,
                ..server.clone()
            });
        }
    }

    async fn tunnel(&mut self, url: &IceUrl, nearest: Scope) -> std::io::Result<SocketAddr> {
        let place = (url.host.clone(), url.port);
        if let Some(tunnel) = self.tunnels.get(&place) {
            return Ok(tunnel.address());
        }
        let addresses = resolve(&url.host, url.port, nearest).await;
        if addresses.is_empty() {
            let why =
                "it has no address, or only such as are nearer than the server which names it";
            return Err(std::io::Error::other(why));
        }
        let tunnel = Tunnel::open(addresses).await?;
        let address = tunnel.address();
        self.tunnels.insert(place, tunnel);
        Ok(address)
    }
}

fn is_over_udp(url: &IceUrl) -> bool {
    matches!(url.kind, IceKind::Stun | IceKind::TurnUdp)
}

fn relay(url: &IceUrl, transport: RelayTransport) -> Relay {
    Relay {
        host: url.host.clone(),
        port: url.port,
        transport,
    }
}

/// The addresses of a server that answer STUN over UDP, one of each family at most.
async fn answers(host: &str, port: u16, nearest: Scope) -> Vec<SocketAddr> {
    let asked = async {
        let found = resolve(host, port, nearest).await;
        let (v4, v6): (Vec<_>, Vec<_>) = found.into_iter().partition(SocketAddr::is_ipv4);
        let mut asked = JoinSet::new();
        for address in [v4.first(), v6.first()].into_iter().flatten().copied() {
            asked.spawn(async move { ask(address).await.map(|_| address) });
        }
        let mut answering = Vec::new();
        while let Some(answer) = asked.join_next().await {
            let Ok(Ok(address)) = answer else {
                continue;
            };
            answering.push(address);
            if let Ok(Some(Ok(Ok(other)))) = timeout(OTHER_ADDRESS, asked.join_next()).await {
                answering.push(other);
            }
            break;
        }
        answering
    };
    timeout(UNREACHABLE, asked).await.unwrap_or_default()
}

async fn ask(server: SocketAddr) -> std::io::Result<SocketAddr> {
    let any: IpAddr = if server.is_ipv4() {
        Ipv4Addr::UNSPECIFIED.into()
    } else {
        Ipv6Addr::UNSPECIFIED.into()
    };
    let socket = UdpSocket::bind((any, 0)).await?;
    // So that a port that nothing listens on is told.
    socket.connect(server).await?;
    ask_from(&socket, server).await
}

/// Asks a STUN server from `socket`, which nothing else reads, until it answers: the address that it sees. Without end where it does not.
pub(crate) async fn ask_from(
    socket: &UdpSocket,
    server: SocketAddr,
) -> std::io::Result<SocketAddr> {
    let mut request = Message::new();
    let build = request.build(&[Box::<TransactionId>::default(), Box::new(BINDING_REQUEST)]);
    build.map_err(std::io::Error::other)?;
    let mut buffer = [0; 1500];
    let mut pauses = ASK_AGAIN.into_iter();
    loop {
        if socket.peer_addr().is_ok() {
            socket.send(&request.raw).await?;
        } else {
            socket.send_to(&request.raw, server).await?;
        }
        let pause = pauses.next().unwrap_or(UNREACHABLE);
        let begun = Instant::now();
        while let Ok(received) = timeout(
            pause.saturating_sub(begun.elapsed()),
            socket.recv_from(&mut buffer),
        )
        .await
        {
            let (count, from) = received?;
            let bytes = buffer.get(..count).unwrap_or_default();
            let mut answer = Message::new();
            if from == server
                && is_stun_message(bytes)
                && answer.unmarshal_binary(bytes).is_ok()
                && answer.typ == BINDING_SUCCESS
                && answer.transaction_id == request.transaction_id
            {
                let mut seen = XorMappedAddress::default();
                seen.get_from(&answer).map_err(std::io::Error::other)?;
                return Ok(SocketAddr::new(seen.ip, seen.port));
            }
        }
    }
}
