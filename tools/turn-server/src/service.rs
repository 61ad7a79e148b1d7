//! What the server does with each packet: RFC 8656 for relays over UDP, and STUN's Binding.

use crate::allocation::{Allocation, CHANNELS, Client, Refused, Side, Terms, Way};
use crate::budget::Budget;
use crate::config::Config;
use crate::credentials::{Name, REALM, hmac};
use crate::message::{Message, Writer, attribute, kind};
use crate::peers::Reach;
use crate::table::{Full, Table};
use hmac::Mac;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::net::UdpSocket;

/// Bytes of the largest packet that is relayed.
pub(crate) const MAX_PACKET: usize = 2048;
/// An allocation's lifetime where the client asks for none.
const DEFAULT_LIFETIME: Duration = Duration::from_secs(600);
/// How long a nonce is good.
const NONCE_LIFETIME: u64 = 3600;
/// Ports that are lent, as RFC 8656 recommends, and how many are tried.
const PORTS: std::ops::RangeInclusive<u16> = 49_152..=65_535;
const PORT_TRIES: usize = 32;
/// The protocol number of UDP.
const UDP: u8 = 17;

/// The server's state.
#[derive(Debug)]
pub(crate) struct Service {
    config: Config,
    /// What nonces are made from.
    nonce_key: [u8; 32],
    table: Mutex<Table>,
    total: Mutex<Budget>,
    unauthenticated: Mutex<Budget>,
}

/// A request's error response.
#[derive(Debug)]
struct Refusal {
    code: u16,
    reason: &'static str,
}

const BAD_REQUEST: Refusal = refusal(400, "Bad Request");
const UNAUTHORIZED: Refusal = refusal(401, "Unauthorized");
const FORBIDDEN: Refusal = refusal(403, "Forbidden");
const UNKNOWN_ATTRIBUTE: Refusal = refusal(420, "Unknown Attribute");
const MISMATCH: Refusal = refusal(437, "Allocation Mismatch");
const STALE_NONCE: Refusal = refusal(438, "Stale Nonce");
const FAMILY: Refusal = refusal(440, "Address Family not Supported");
const WRONG_CREDENTIALS: Refusal = refusal(441, "Wrong Credentials");
const TRANSPORT: Refusal = refusal(442, "Unsupported Transport Protocol");
const PEER_FAMILY: Refusal = refusal(443, "Peer Address Family Mismatch");
const QUOTA: Refusal = refusal(486, "Allocation Quota Reached");
const NO_CAPACITY: Refusal = refusal(508, "Insufficient Capacity");

const fn refusal(code: u16, reason: &'static str) -> Refusal {
    Refusal { code, reason }
}

/// Who sent an authenticated request.
struct Bearer<'a> {
    username: &'a str,
    name: Name<'a>,
    key: [u8; 16],
}

impl Service {
    pub(crate) fn new(config: Config) -> Result<Self, getrandom::Error> {
        let now = Instant::now();
        let mut nonce_key = [0; 32];
        getrandom::fill(&mut nonce_key)?;
        let limits = &config.limits;
        Ok(Self {
            nonce_key,
            table: Mutex::new(Table::new(limits)),
            total: Mutex::new(Budget::new(limits.bytes_per_second, now)),
            unauthenticated: Mutex::new(Budget::new(limits.unauthenticated_per_second, now)),
            config,
        })
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    /// Handles a packet of `client`, whose answers go `way`. Returns whether the client has an allocation now.
    pub(crate) fn handle(self: &Arc<Self>, client: Client, way: &Way, packet: &[u8]) -> bool {
        match packet.first() {
            Some(0x00..=0x3F) => {
                if let Some(message) = Message::read(packet)
                    && let Some(answer) = self.answer(client, way, &message)
                {
                    way.send(answer);
                }
            }
            Some(0x40..=0x4F) => self.channel_data(client, packet),
            _ => {}
        }
        self.allocation(client).is_some()
    }

    /// Ends what a client has, because its connection has ended.
    pub(crate) fn forget(&self, client: &Client) {
        if let Some(allocation) = self.allocation(*client) {
            allocation.ended.cancel();
        }
    }

    /// Ends all allocations.
    pub(crate) fn stop(&self) {
        self.table().all().for_each(|it| it.ended.cancel());
    }

    fn answer(
        self: &Arc<Self>,
        client: Client,
        way: &Way,
        message: &Message<'_>,
    ) -> Option<Vec<u8>> {
        let requests = [
            kind::BINDING_REQUEST,
            kind::ALLOCATE_REQUEST,
            kind::REFRESH_REQUEST,
            kind::CREATE_PERMISSION_REQUEST,
            kind::CHANNEL_BIND_REQUEST,
        ];
        match message.kind() {
            kind::SEND_INDICATION => {
                self.send_indication(client, message);
                return None;
            }
            request if !requests.contains(&request) => return None,
            kind::BINDING_REQUEST => {
                return self.may_answer_strangers().then(|| {
                    Writer::new(kind::BINDING_REQUEST | kind::SUCCESS, message.transaction())
                        .address(attribute::XOR_MAPPED_ADDRESS, client.address)
                        .finish()
                });
            }
            _ => {}
        }
        let bearer = match self.authenticate(client, message) {
            Ok(bearer) => bearer,
            Err(refusal) => {
                return self
                    .may_answer_strangers()
                    .then(|| self.refuse(client, message, &refusal, None));
            }
        };
        let unknown = message.not_understood();
        let answer = if unknown.is_empty() {
            self.authenticated(client, way, message, &bearer)
        } else {
            Err(UNKNOWN_ATTRIBUTE)
        };
        Some(match answer {
            Ok(answer) => answer.signed(&bearer.key).finish(),
            Err(refusal) => {
                log::debug!(
                    "a request of {} is refused: {}",
                    client.address,
                    refusal.reason
                );
                self.refuse(client, message, &refusal, Some(&bearer.key))
            }
        })
    }

    fn authenticated(
        self: &Arc<Self>,
        client: Client,
        way: &Way,
        message: &Message<'_>,
        bearer: &Bearer<'_>,
    ) -> Result<Writer, Refusal> {
        let answer = Writer::new(message.kind() | kind::SUCCESS, message.transaction());
        if message.kind() == kind::ALLOCATE_REQUEST {
            let allocation = self.allocate(client, way, message, bearer)?;
            let left = allocation
                .expires()
                .saturating_duration_since(Instant::now());
            return Ok(answer
                .address(attribute::XOR_RELAYED_ADDRESS, allocation.terms.relayed)
                .address(attribute::XOR_MAPPED_ADDRESS, client.address)
                .add(attribute::LIFETIME, &seconds(left)));
        }
        let now = Instant::now();
        let allocation = self.allocation(client).ok_or(MISMATCH)?;
        match message.kind() {
            kind::REFRESH_REQUEST => {
                let lifetime = self.lifetime(message);
                let oldest = allocation.born + self.config.limits.age;
                let expires = (now + lifetime).min(oldest);
                allocation.set_expiry(expires);
                if lifetime.is_zero() {
                    self.end(&allocation);
                }
                let left = seconds(expires.saturating_duration_since(now));
                Ok(answer.add(attribute::LIFETIME, &left))
            }
            kind::CREATE_PERMISSION_REQUEST => {
                let limit = self.config.limits.peers_per_allocation;
                let peers: Option<Vec<_>> = message.peers().take(limit + 1).collect();
                let peers = peers.filter(|peers| !peers.is_empty()).ok_or(BAD_REQUEST)?;
                // All or none of them.
                let sides: Vec<_> = peers
                    .iter()
                    .map(|peer| self.side_of(&allocation, *peer))
                    .collect::<Result<_, _>>()?;
                for (peer, side) in peers.iter().zip(sides) {
                    allocation.permit(peer.ip(), side, now)?;
                }
                Ok(answer)
            }
            kind::CHANNEL_BIND_REQUEST => {
                let number = message.number(attribute::CHANNEL_NUMBER);
                let number = number.and_then(|number| u16::try_from(number >> 16).ok());
                let number = number.filter(|number| CHANNELS.contains(number));
                let peer = message.peers().next().flatten();
                let (number, peer) = number.zip(peer).ok_or(BAD_REQUEST)?;
                let side = self.side_of(&allocation, peer)?;
                allocation.bind(number, peer, side, now)?;
                Ok(answer)
            }
            _ => Err(BAD_REQUEST),
        }
    }

    /// Who sent a request, if its credentials are genuine, fresh, and those of its allocation.
    fn authenticate<'a>(
        &self,
        client: Client,
        message: &Message<'a>,
    ) -> Result<Bearer<'a>, Refusal> {
        if !message.has_integrity() {
            return Err(UNAUTHORIZED);
        }
        let username = message.text(attribute::USERNAME).ok_or(BAD_REQUEST)?;
        let realm = message.text(attribute::REALM).ok_or(BAD_REQUEST)?;
        let nonce = message.text(attribute::NONCE).ok_or(BAD_REQUEST)?;
        if !self.is_fresh(nonce, client) {
            return Err(STALE_NONCE);
        }
        let name = Name::read(username).ok_or(UNAUTHORIZED)?;
        let key = self.config.key.long_term(username).ok_or(UNAUTHORIZED)?;
        if realm != REALM || !message.verify(&key) {
            return Err(UNAUTHORIZED);
        }
        match self.allocation(client) {
            // An allocation lives on with the credentials that made it; they allow no other.
            Some(allocation) if allocation.terms.username != username => {
                return Err(WRONG_CREDENTIALS);
            }
            Some(_) => {}
            None if name.expires <= unix_now() => return Err(UNAUTHORIZED),
            None => {}
        }
        Ok(Bearer {
            username,
            name,
            key,
        })
    }

    fn allocate(
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
        self.table().has_room(&client, bearer.name.subject)?;
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
            subject: bearer.name.subject.to_owned(),
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
        self.table().insert(Arc::clone(&allocation))?;
        log::debug!("{} is lent {}", client.address, allocation.terms.relayed);
        tokio::spawn(relay(Arc::clone(self), Arc::clone(&allocation)));
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

    /// Where packets from `allocation` to `peer` would go, if they may.
    fn side_of(&self, allocation: &Allocation, peer: SocketAddr) -> Result<Side, Refusal> {
        let (ip, relayed) = (peer.ip().to_canonical(), allocation.terms.relayed.ip());
        if ip.is_ipv4() != relayed.is_ipv4() {
            return Err(PEER_FAMILY);
        }
        if self.table().lends(ip) || Some(ip) == self.config.external {
            return Ok(Side::Inside);
        }
        let reach = if self.config.private_peers {
            Reach::Private
        } else {
            Reach::Public
        };
        // Only addresses of this machine can be bound.
        let own = std::net::UdpSocket::bind((ip, 0)).is_ok();
        if own || !reach.allows(ip) {
            return Err(FORBIDDEN);
        }
        Ok(Side::Outside)
    }

    fn send_indication(&self, client: Client, message: &Message<'_>) {
        let peer = message.peers().next().flatten();
        let data = message.get(attribute::DATA);
        if let Some((peer, data)) = peer.zip(data)
            && let Some(allocation) = self.allocation(client)
        {
            self.relay_out(&allocation, peer, data);
        }
    }

    fn channel_data(&self, client: Client, packet: &[u8]) {
        let Some(([a, b, c, d], rest)) = packet.split_first_chunk() else {
            return;
        };
        let number = u16::from_be_bytes([*a, *b]);
        let length = usize::from(u16::from_be_bytes([*c, *d]));
        let Some(data) = rest.get(..length) else {
            return;
        };
        let Some(allocation) = self.allocation(client) else {
            return;
        };
        if let Some(peer) = allocation.peer(number, Instant::now()) {
            self.relay_out(&allocation, peer, data);
        }
    }

    /// Sends a client's data to a peer, if it has a permission and the rate allows it.
    fn relay_out(&self, allocation: &Allocation, peer: SocketAddr, data: &[u8]) {
        let now = Instant::now();
        let Some(side) = allocation.side(peer.ip(), now) else {
            return;
        };
        if !self.spend(allocation, data.len(), now) {
            return;
        }
        match side {
            Side::Inside => {
                let other = self.table().lent(peer);
                if let Some(other) = other
                    && self.spend(&other, data.len(), now)
                {
                    other.deliver(allocation.terms.relayed, data, now);
                }
            }
            Side::Outside => {
                if let Err(error) = allocation.terms.socket.try_send_to(data, peer) {
                    log::trace!("a packet to {peer} is dropped: {error}");
                }
            }
        }
    }

    fn spend(&self, allocation: &Allocation, bytes: usize, now: Instant) -> bool {
        // The headers of IP and UDP cost as well.
        let bytes = bytes + 28;
        allocation.spend(bytes, now) && lock(&self.total).take(bytes, now)
    }

    fn end(&self, allocation: &Allocation) {
        allocation.ended.cancel();
        self.table().remove(allocation);
    }

    /// The lifetime that a request asks for, within bounds.
    fn lifetime(&self, message: &Message<'_>) -> Duration {
        let asked = message.number(attribute::LIFETIME);
        asked
            .map_or(DEFAULT_LIFETIME, |seconds| {
                Duration::from_secs(seconds.into())
            })
            .min(self.config.limits.lifetime)
    }

    /// An error response; one that asks for credentials carries the realm and a nonce.
    fn refuse(
        &self,
        client: Client,
        message: &Message<'_>,
        refusal: &Refusal,
        key: Option<&[u8]>,
    ) -> Vec<u8> {
        let mut answer = Writer::new(message.kind() | kind::ERROR, message.transaction())
            .error(refusal.code, refusal.reason);
        match refusal.code {
            401 | 438 => {
                let nonce = self.nonce(unix_now(), client);
                answer = answer
                    .add(attribute::REALM, REALM.as_bytes())
                    .add(attribute::NONCE, nonce.as_bytes());
            }
            420 => {
                let unknown: Vec<u8> = message
                    .not_understood()
                    .iter()
                    .flat_map(|kind| kind.to_be_bytes())
                    .collect();
                answer = answer.add(attribute::UNKNOWN_ATTRIBUTES, &unknown);
            }
            _ => {}
        }
        match key {
            Some(key) => answer.signed(key).finish(),
            None => answer.finish(),
        }
    }

    /// A nonce that only this client can use, without the server keeping it.
    fn nonce(&self, time: u64, client: Client) -> String {
        let tag = hmac(
            &self.nonce_key,
            format!("{time} {}", client.address).as_bytes(),
        )
        .finalize()
        .into_bytes();
        let tag: String = tag
            .iter()
            .take(8)
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!("{time:x}-{tag}")
    }

    fn is_fresh(&self, nonce: &str, client: Client) -> bool {
        let time = nonce.split('-').next();
        let time = time.and_then(|time| u64::from_str_radix(time, 16).ok());
        time.is_some_and(|time| {
            // A nonce is no secret: anyone may ask for one.
            nonce == self.nonce(time, client) && unix_now().saturating_sub(time) < NONCE_LIFETIME
        })
    }

    fn may_answer_strangers(&self) -> bool {
        lock(&self.unauthenticated).take(1, Instant::now())
    }

    /// A client's allocation. The table is no longer locked once this returns.
    fn allocation(&self, client: Client) -> Option<Arc<Allocation>> {
        self.table().get(&client)
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        lock(&self.table)
    }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Self {
        match refused {
            Refused::TooMany => NO_CAPACITY,
            Refused::Mismatch => BAD_REQUEST,
        }
    }
}

impl From<Full> for Refusal {
    fn from(full: Full) -> Self {
        log::warn!("an allocation is refused: {full}");
        match full {
            Full::Server => NO_CAPACITY,
            Full::Subject | Full::Address => QUOTA,
        }
    }
}

/// Hands what arrives at the lent address to the client, until the allocation ends.
async fn relay(service: Arc<Service>, allocation: Arc<Allocation>) {
    let mut buffer = vec![0; MAX_PACKET];
    loop {
        let expires = allocation.expires();
        if expires <= Instant::now() {
            break;
        }
        let received = tokio::select! {
            () = allocation.ended.cancelled() => break,
            () = tokio::time::sleep_until(expires.into()) => continue,
            () = allocation.refreshed.notified() => continue,
            received = allocation.terms.socket.recv_from(&mut buffer) => received,
        };
        match received {
            Ok((length, from)) => {
                let now = Instant::now();
                let ip = from.ip().to_canonical();
                let data = buffer.get(..length).unwrap_or_default();
                // What comes from the network cannot come from inside, whatever address it bears.
                if allocation.side(ip, now) == Some(Side::Outside)
                    && service.spend(&allocation, length, now)
                {
                    allocation.deliver(from, data, now);
                }
            }
            Err(error) => {
                log::debug!("receiving on {}: {error}", allocation.terms.relayed);
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        }
    }
    service.end(&allocation);
    log::debug!("{} is no longer lent", allocation.terms.relayed);
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

fn seconds(duration: Duration) -> [u8; 4] {
    // Rounded up, so that a client refreshes no lifetime of zero.
    u32::try_from(duration.as_millis().div_ceil(1000))
        .unwrap_or(u32::MAX)
        .to_be_bytes()
}

fn unix_now() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs())
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing in there is left half done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
