//! Lending an address: which one, to whom, and for how long.

use super::authentication::Bearer;
use super::refusal::{BAD_REQUEST, FAMILY, MISMATCH, NO_CAPACITY, Refusal, TRANSPORT};
use super::{Service, relaying};
use crate::allocation::{Allocation, Client, Terms, Way};
use crate::holder::Holder;
use crate::message::{Message, attribute};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::net::UdpSocket;

/// An allocation's lifetime where the client asks for none.
const DEFAULT_LIFETIME: Duration = Duration::from_secs(600);
/// Ports that are lent, as RFC 8656 recommends, and how many are tried.
const PORTS: std::ops::RangeInclusive<u16> = 49_152..=65_535;
const PORT_TRIES: usize = 32;
/// The protocol number of UDP.
const UDP: u8 = 17;

impl Service {
    pub(super) fn allocate(
        self: &Arc<Self>,
        client: Client,
        way: &Way,
        message: &Message<'_>,
        bearer: &Bearer<'_>,
    ) -> Result<Arc<Allocation>, Refusal> {
        if let Some(allocation) = self.allocation(client) {
            // The client repeats a request whose answer it did not get.
            if allocation.terms.transaction == message.transaction() {
                return Ok(allocation);
            }
            return Err(MISMATCH);
        }
        match message.get(attribute::REQUESTED_TRANSPORT) {
            Some([UDP, ..]) => {}
            Some(_) => return Err(TRANSPORT),
            None => return Err(BAD_REQUEST),
        }
        let (v4, v6) = (Ipv4Addr::UNSPECIFIED.into(), Ipv6Addr::UNSPECIFIED.into());
        let families: &[IpAddr] = match message.get(attribute::REQUESTED_ADDRESS_FAMILY) {
            // Who asks for no family gets IPv4 (RFC 8656, section 7.2), or IPv6 on a network without IPv4.
            None => &[v4, v6],
            Some([1, ..]) => &[v4],
            Some([2, ..]) => &[v6],
            Some(_) => return Err(FAMILY),
        };
        let ip = families
            .iter()
            .find_map(|family| self.local_ip(client, *family))
            .ok_or(FAMILY)?;
        let holder = Holder::from(bearer.name.subject);
        let has_room = self.table().has_room(&client, &holder);
        has_room.map_err(|full| self.full(full))?;
        let socket = bind_relay(if self.config.listen.ip().is_unspecified() {
            if ip.is_ipv4() { v4 } else { v6 }
        } else {
            ip
        })?;
        let port = socket.local_addr().map_err(|_| NO_CAPACITY)?.port();
        let external = self
            .config
            .external
            .filter(|it| it.is_ipv4() == ip.is_ipv4());
        let limits = &self.config.limits;
        let now = Instant::now();
        let terms = Terms {
            client,
            way: way.clone(),
            username: bearer.username.to_owned(),
            holder,
            relayed: SocketAddr::new(external.unwrap_or(ip), port),
            socket,
            transaction: message.transaction(),
            lifetime: match self.lifetime(message) {
                Duration::ZERO => DEFAULT_LIFETIME.min(limits.lifetime),
                lifetime => lifetime,
            },
            limit: limits.peers_per_allocation,
            bytes_per_second: limits.allocation_bytes_per_second,
        };
        let allocation = Arc::new(Allocation::new(terms, now));
        let inserted = self.table().insert(Arc::clone(&allocation));
        inserted.map_err(|full| self.full(full))?;
        log::debug!("{} is lent {}", client.address, allocation.terms.relayed);
        tokio::spawn(relaying::relay(Arc::clone(self), Arc::clone(&allocation)));
        Ok(allocation)
    }

    /// The address of this machine by which `client` reaches it, of the same family as `family`, or the one by which the world does.
    fn local_ip(&self, client: Client, family: IpAddr) -> Option<IpAddr> {
        let listen = self.config.listen.ip();
        if !listen.is_unspecified() {
            return (listen.is_ipv4() == family.is_ipv4()).then_some(listen);
        }
        let documentation = Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1);
        let world: IpAddr = match family {
            IpAddr::V4(_) => Ipv4Addr::new(192, 0, 2, 1).into(),
            IpAddr::V6(_) => documentation.into(),
        };
        let client = client.address.ip();
        let on_this_machine = client.is_loopback();
        let same = client.is_ipv4() == family.is_ipv4();
        // A client on this machine talks with others who are not. Nothing is sent: connecting a UDP socket only chooses a route.
        let towards = |to: IpAddr| {
            let socket = std::net::UdpSocket::bind((family, 0)).ok()?;
            socket.connect((to, 9)).ok()?;
            Some(socket.local_addr().ok()?.ip())
        };
        let first = if same && !on_this_machine {
            client
        } else {
            world
        };
        towards(first).or_else(|| same.then(|| towards(client)).flatten())
    }

    /// The lifetime that a request asks for, within bounds.
    pub(super) fn lifetime(&self, message: &Message<'_>) -> Duration {
        let asked = message.number(attribute::LIFETIME);
        asked
            .map_or(DEFAULT_LIFETIME, |seconds| {
                Duration::from_secs(seconds.into())
            })
            .min(self.config.limits.lifetime)
    }
}

/// A socket on a port at random.
fn bind_relay(ip: IpAddr) -> Result<UdpSocket, Refusal> {
    for _ in 0..PORT_TRIES {
        let port = fastrand::u16(PORTS);
        let bound = std::net::UdpSocket::bind((ip, port)).and_then(|socket| {
            socket.set_nonblocking(true)?;
            UdpSocket::from_std(socket)
        });
        if let Ok(socket) = bound {
            return Ok(socket);
        }
    }
    log::warn!("no port is free to be lent");
    Err(NO_CAPACITY)
}
