//! What the server does with each packet: RFC 8656 for relays over UDP, and STUN's Binding.

mod allocating;
mod authentication;
mod refusal;
mod relaying;

use crate::allocation::{Allocation, CHANNELS, Client, Way};
use crate::budget::Budget;
use crate::config::Config;
use crate::message::{Message, Writer, attribute, kind};
use crate::strangers::Strangers;
use crate::table::Table;
use authentication::Bearer;
use refusal::{BAD_REQUEST, MISMATCH, Refusal, UNKNOWN_ATTRIBUTE};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Bytes of the largest packet that is relayed.
pub(crate) const MAX_PACKET: usize = 2048;

/// The server's state.
#[derive(Debug)]
pub(crate) struct Service {
    config: Config,
    /// What nonces are made from.
    nonce_key: [u8; 32],
    table: Mutex<Table>,
    total: Mutex<Budget>,
    strangers: Mutex<Strangers>,
    counts: Mutex<Counts>,
}

/// What a server has refused since its start, and what it lends now.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Allocations there are.
    pub allocations: usize,
    /// Allocations refused because the server had as many as it may.
    pub refused_by_server: u64,
    /// The same, because the room's owner had as many as it left free.
    pub refused_by_owner: u64,
    /// The same, because the room had as many as it may.
    pub refused_by_room: u64,
    /// The same, because the token had as many as it may.
    pub refused_by_token: u64,
    /// The same, because the address had as many as it may.
    pub refused_by_address: u64,
    /// Requests whose token is revoked.
    pub revoked: u64,
    /// Requests without valid credentials that got no answer, because there were too many.
    pub unanswered: u64,
    /// TCP connections refused because there were too many.
    pub connections_refused: u64,
    /// Packets and connections of blocked addresses.
    pub blocked: u64,
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
            strangers: Mutex::new(Strangers::new(limits, now)),
            counts: Mutex::default(),
            config,
        })
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    /// What was refused so far, and what is lent.
    pub(crate) fn counts(&self) -> Counts {
        let allocations = self.table().len();
        Counts {
            allocations,
            ..*lock(&self.counts)
        }
    }

    /// Counts something that was refused.
    pub(crate) fn count(&self, one: impl FnOnce(&mut Counts) -> &mut u64) {
        *one(&mut lock(&self.counts)) += 1;
    }

    /// Whether the address is blocked, which is counted.
    pub(crate) fn is_blocked(&self, address: IpAddr) -> bool {
        let is_blocked = self.config.admission.is_blocked(address);
        if is_blocked {
            self.count(|counts| &mut counts.blocked);
        }
        is_blocked
    }

    /// Ends the allocations of whom the server admits no longer.
    pub(crate) fn end_refused(&self) {
        let admission = &self.config.admission;
        let table = self.table();
        let refused = table.all().filter(|allocation| {
            let (client, holder) = (&allocation.terms.client, &allocation.terms.holder);
            admission.is_blocked(client.address.ip())
                || !admission.honours(&holder.room, &holder.tokens)
        });
        refused.for_each(|allocation| allocation.ended.cancel());
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
                return self.may_answer_stranger(client).then(|| {
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
                    .may_answer_stranger(client)
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

    fn end(&self, allocation: &Allocation) {
        allocation.ended.cancel();
        self.table().remove(allocation);
    }

    fn may_answer_stranger(&self, client: Client) -> bool {
        let may = lock(&self.strangers).take(client.address.ip(), Instant::now());
        if !may {
            self.count(|counts| &mut counts.unanswered);
        }
        may
    }

    /// A client's allocation. The table is no longer locked once this returns.
    fn allocation(&self, client: Client) -> Option<Arc<Allocation>> {
        self.table().get(&client)
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        lock(&self.table)
    }
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
