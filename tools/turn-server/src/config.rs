//! A server's configuration, with every bound it keeps.

use crate::credentials::Key;
use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

/// Who may use a server, which changes while it runs. It is asked for each packet and each request, so it answers at
/// once.
pub trait Admission: fmt::Debug + Send + Sync {
    /// Whether credentials of these tokens ([`crate::credentials::Subject::tokens`]) in this room are still honoured.
    fn honours(&self, room: &str, tokens: &str) -> bool;

    /// Whether packets and connections from this address are dropped.
    fn is_blocked(&self, address: IpAddr) -> bool;
}

/// Admits everyone who has credentials.
#[derive(Debug)]
struct Everyone;

impl Admission for Everyone {
    fn honours(&self, _: &str, _: &str) -> bool {
        true
    }

    fn is_blocked(&self, _: IpAddr) -> bool {
        false
    }
}

/// A server's configuration.
#[derive(Debug, Clone)]
pub struct Config {
    /// Where to listen, with UDP and TCP; port 0 takes a free one.
    pub listen: SocketAddr,
    /// The address by which the world reaches this server, where it is not one of its own (behind a NAT that hands all or the relayed ports
    /// on).
    pub external: Option<IpAddr>,
    /// What credentials are made from.
    pub key: Key,
    /// Whether packets may be relayed into private networks, for a server whose users are all in one.
    pub private_peers: bool,
    /// The certificate with which TCP connections may speak TLS.
    #[cfg(feature = "tls")]
    pub tls: Option<Arc<rustls::ServerConfig>>,
    /// Who may use it.
    pub admission: Arc<dyn Admission>,
    /// Bounds.
    pub limits: Limits,
}

impl Config {
    /// A server that relays to the internet only, without TLS, with the default bounds.
    #[must_use]
    pub fn new(listen: SocketAddr, key: Key) -> Self {
        Self {
            listen,
            external: None,
            key,
            private_peers: false,
            #[cfg(feature = "tls")]
            tls: None,
            admission: Arc::new(Everyone),
            limits: Limits::default(),
        }
    }
}

/// Every bound a server keeps, so that no client makes it grow.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Allocations at once.
    pub allocations: usize,
    /// The same, of one room.
    pub allocations_per_room: usize,
    /// How many of a room's are kept for its sender.
    pub allocations_of_sender: usize,
    /// The same, of one token in a room that is not the sender's.
    pub allocations_per_token: usize,
    /// The same, of one such token and one client address: many viewers may have one link. Four times as many for a
    /// member, who is connected with each of the others.
    pub allocations_per_token_and_address: usize,
    /// The same, of one client address (IPv6: one /56).
    pub allocations_per_address: usize,
    /// Addresses that one allocation may exchange packets with, and channels.
    pub peers_per_allocation: usize,
    /// Bytes a second that one allocation may pass on, both ways together.
    pub allocation_bytes_per_second: u64,
    /// The same, of all allocations together.
    pub bytes_per_second: u64,
    /// Answers a second to requests without valid credentials, of all clients together: such requests may have forged senders.
    pub unauthenticated_per_second: u64,
    /// The same, of one client address (IPv6: one /56), in the long run; five times as many at once.
    pub unauthenticated_per_address: u64,
    /// TCP connections at once.
    pub connections: usize,
    /// The same, from one address (IPv6: one /56).
    pub connections_per_address: usize,
    /// The longest that an allocation lives without being refreshed, and the longest at all.
    pub lifetime: Duration,
    /// How old an allocation may become.
    pub age: Duration,
    /// How long a TCP connection may be without an allocation.
    pub idle: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            allocations: 4096,
            allocations_per_room: 256,
            allocations_of_sender: 32,
            allocations_per_token: 128,
            allocations_per_token_and_address: 8,
            allocations_per_address: 128,
            peers_per_allocation: 32,
            // A call takes 20 KB/s; the rest is for what browsers may add.
            allocation_bytes_per_second: 250_000,
            bytes_per_second: 50_000_000,
            unauthenticated_per_second: 2000,
            unauthenticated_per_address: 20,
            connections: 2048,
            connections_per_address: 128,
            lifetime: Duration::from_secs(600),
            age: Duration::from_secs(86_400),
            idle: Duration::from_secs(20),
        }
    }
}
