//! An allocation: the address that the server lends a client, whom it may exchange packets with, and how they reach the client.

use crate::budget::Budget;
use crate::holder::Holder;
use crate::message::{Transaction, Writer, attribute, kind};
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::UdpSocket;
use tokio::sync::{Notify, mpsc};
use tokio_util::sync::CancellationToken;

/// How long a permission and a channel hold (RFC 8656, sections 9 and 12).
const PERMISSION: Duration = Duration::from_secs(300);
const CHANNEL: Duration = Duration::from_secs(600);
/// The numbers that channels may have.
pub(crate) const CHANNELS: std::ops::RangeInclusive<u16> = 0x4000..=0x4FFF;

/// A client, by the connection that its packets come on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Client {
    pub(crate) address: SocketAddr,
    /// The number of its TCP connection; `None` for UDP.
    pub(crate) connection: Option<u64>,
}

/// How packets reach a client.
#[derive(Debug, Clone)]
pub(crate) enum Way {
    Udp(Arc<UdpSocket>, SocketAddr),
    Tcp(mpsc::Sender<Vec<u8>>),
}

impl Way {
    /// Sends a packet, or drops it where too many wait, as a network would.
    pub(crate) fn send(&self, packet: Vec<u8>) {
        match self {
            Self::Udp(socket, to) => {
                if let Err(error) = socket.try_send_to(&packet, *to) {
                    log::trace!("a packet to {to} is dropped: {error}");
                }
            }
            Self::Tcp(connection) => {
                if connection.try_send(packet).is_err() {
                    log::trace!("a packet on a full or closed connection is dropped");
                }
            }
        }
    }
}

/// Where a peer's address leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// To the other addresses that this server lends: handed over within the process, never through a socket.
    Inside,
    /// To the network.
    Outside,
}

/// An allocation.
#[derive(Debug)]
pub(crate) struct Allocation {
    pub(crate) terms: Terms,
    pub(crate) born: Instant,
    pub(crate) ended: CancellationToken,
    /// It expires at another time now.
    pub(crate) refreshed: Notify,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    expires: Instant,
    permissions: HashMap<IpAddr, (Side, Instant)>,
    channels: Vec<Channel>,
    budget: Budget,
}

#[derive(Debug, Clone, Copy)]
struct Channel {
    number: u16,
    peer: SocketAddr,
    expires: Instant,
}

/// What an allocation is made from, and does not change.
#[derive(Debug)]
pub(crate) struct Terms {
    pub(crate) client: Client,
    pub(crate) way: Way,
    pub(crate) username: String,
    pub(crate) holder: Holder,
    /// The address that is lent, as peers see it.
    pub(crate) relayed: SocketAddr,
    pub(crate) socket: UdpSocket,
    /// The transaction that made it.
    pub(crate) transaction: Transaction,
    /// How long it lasts unless it is refreshed.
    pub(crate) lifetime: Duration,
    /// Peers and channels.
    pub(crate) limit: usize,
    pub(crate) bytes_per_second: u64,
}

/// The error of too many peers, or of a channel that is another peer's.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Refused {
    TooMany,
    Mismatch,
}

impl Allocation {
    pub(crate) fn new(terms: Terms, now: Instant) -> Self {
        Self {
            born: now,
            ended: CancellationToken::new(),
            refreshed: Notify::new(),
            state: Mutex::new(State {
                expires: now + terms.lifetime,
                permissions: HashMap::new(),
                channels: Vec::new(),
                budget: Budget::new(terms.bytes_per_second, now),
            }),
            terms,
        }
    }

    pub(crate) fn expires(&self) -> Instant {
        self.state().expires
    }

    pub(crate) fn set_expiry(&self, expires: Instant) {
        self.state().expires = expires;
        self.refreshed.notify_one();
    }

    /// Lets packets pass to and from `ip` for five minutes.
    pub(crate) fn permit(&self, ip: IpAddr, side: Side, now: Instant) -> Result<(), Refused> {
        self.state().permit(ip, side, now, self.terms.limit)
    }

    /// Gives `peer` a channel for ten minutes, and a permission.
    pub(crate) fn bind(
        &self,
        number: u16,
        peer: SocketAddr,
        side: Side,
        now: Instant,
    ) -> Result<(), Refused> {
        let mut state = self.state();
        state.channels.retain(|channel| channel.expires > now);
        let full = state.channels.len() >= self.terms.limit;
        let expires = now + CHANNEL;
        let mut channels = state.channels.iter_mut();
        match channels.find(|channel| channel.number == number || channel.peer == peer) {
            Some(channel) if channel.number == number && channel.peer == peer => {
                channel.expires = expires;
            }
            Some(_) => return Err(Refused::Mismatch),
            None if full => return Err(Refused::TooMany),
            None => state.channels.push(Channel {
                number,
                peer,
                expires,
            }),
        }
        state.permit(peer.ip(), side, now, self.terms.limit)
    }

    /// The peer of a channel.
    pub(crate) fn peer(&self, number: u16, now: Instant) -> Option<SocketAddr> {
        let state = self.state();
        let mut channels = state.channels.iter();
        let channel = channels.find(|channel| channel.number == number && channel.expires > now)?;
        Some(channel.peer)
    }

    /// Where packets to `ip` go, if it has a permission.
    pub(crate) fn side(&self, ip: IpAddr, now: Instant) -> Option<Side> {
        let (side, expires) = *self.state().permissions.get(&ip)?;
        (expires > now).then_some(side)
    }

    /// Takes a packet's bytes from what may pass.
    pub(crate) fn spend(&self, bytes: usize, now: Instant) -> bool {
        self.state().budget.take(bytes, now)
    }

    /// Hands a peer's packet to the client, if the peer has a permission.
    pub(crate) fn deliver(&self, from: SocketAddr, data: &[u8], now: Instant) {
        let from = SocketAddr::new(from.ip().to_canonical(), from.port());
        if self.side(from.ip(), now).is_none() {
            return;
        }
        let channel = {
            let state = self.state();
            let mut channels = state.channels.iter();
            channels
                .find(|channel| channel.peer == from && channel.expires > now)
                .map(|channel| channel.number)
        };
        self.terms.way.send(match channel {
            Some(number) => channel_data(number, data),
            None => {
                let mut transaction = [0; 12];
                fastrand::fill(&mut transaction);
                Writer::new(kind::DATA_INDICATION, transaction)
                    .address(attribute::XOR_PEER_ADDRESS, from)
                    .add(attribute::DATA, data)
                    .into_bytes()
            }
        });
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing in there is left half done.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn permit(
        &mut self,
        ip: IpAddr,
        side: Side,
        now: Instant,
        limit: usize,
    ) -> Result<(), Refused> {
        self.permissions.retain(|_, (_, expires)| *expires > now);
        if self.permissions.len() >= limit && !self.permissions.contains_key(&ip) {
            return Err(Refused::TooMany);
        }
        self.permissions.insert(ip, (side, now + PERMISSION));
        Ok(())
    }
}

/// A ChannelData message (RFC 8656, section 12.4), filled up to four bytes as TCP asks for and UDP allows.
fn channel_data(number: u16, data: &[u8]) -> Vec<u8> {
    let mut packet = Vec::with_capacity(data.len() + 8);
    packet.extend_from_slice(&number.to_be_bytes());
    packet.extend_from_slice(&u16::try_from(data.len()).unwrap_or(0).to_be_bytes());
    packet.extend_from_slice(data);
    packet.resize(packet.len().next_multiple_of(4), 0);
    packet
}
