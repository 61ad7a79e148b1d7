//! A server's configuration, with every bound it keeps.

use crate::limit_values::{seconds, whole};
use crate::turn_at::TurnAt;
use crate::{Forwarding, Secret};
use link_protocol::ice::IceUrl;
use link_protocol::limits::{ANSWER_WITHIN, MAX_PACKAGE_BYTES, MAX_SDP_BYTES};
use serde::Deserialize;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// A server's configuration.
#[derive(Clone, Debug)]
pub struct Config {
    /// Where to listen; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Where packages are kept.
    pub store: StoreConfig,
    /// The secret that authenticates tokens.
    pub secret: Secret,
    /// The address of a NATS server through which several instances share their rooms, `nats://HOST:PORT`. A program that can
    /// write to it can answer for any sender: keep it in the instances' own network.
    #[cfg(feature = "nats")]
    pub nats: Option<String>,
    /// Addresses of STUN servers of others that senders and viewers are told.
    pub stun: Vec<IceUrl>,
    /// Relay calls that find no direct way.
    pub turn: Option<TurnConfig>,
    /// The relay of another process, which has the same secret. Where there is one, `turn` is not used.
    pub turn_at: Option<TurnAt>,
    /// What takes viewers whom their senders hand over, if anything does.
    pub forwarding: Option<Arc<dyn Forwarding>>,
    /// Certificate chain and private key, PEM files; without them the server speaks plain HTTP.
    #[cfg(feature = "tls")]
    pub tls: Option<(PathBuf, PathBuf)>,
    /// A file with the names of tokens that hold no longer ([`crate::revoke`]); it need not be there.
    pub revoked: Option<PathBuf>,
    /// A file with addresses and prefixes (`203.0.113.0/24`), one a line, that are not served; it need not be there,
    /// and is read again when it changes.
    pub blocked: Option<PathBuf>,
    /// Bounds.
    pub limits: Limits,
}

impl Config {
    /// One server alone, which speaks plain HTTP and keeps the default bounds.
    #[must_use]
    pub fn new(listen: SocketAddr, store: StoreConfig, secret: Secret) -> Self {
        Self {
            listen,
            store,
            secret,
            #[cfg(feature = "nats")]
            nats: None,
            stun: Vec::new(),
            turn: None,
            turn_at: None,
            forwarding: None,
            #[cfg(feature = "tls")]
            tls: None,
            revoked: None,
            blocked: None,
            limits: Limits::default(),
        }
    }
}

/// A TURN server beside the signaling, for whoever has a room's token. Clients find it by the name that they reach the signaling by.
#[derive(Clone, Debug)]
pub struct TurnConfig {
    /// Where to listen, with UDP and TCP; port 0 takes a free one. Where the server has a certificate, its TCP connections may speak TLS.
    pub listen: SocketAddr,
    /// The address by which the world reaches this machine, where it is not one of its own.
    pub external: Option<IpAddr>,
    /// Whether packets may be relayed into private networks.
    pub private_peers: bool,
    /// Bounds.
    pub limits: turn_server::Limits,
}

impl TurnConfig {
    /// One that relays to the internet only.
    #[must_use]
    pub fn new(listen: SocketAddr) -> Self {
        Self {
            listen,
            external: None,
            private_peers: false,
            limits: turn_server::Limits::default(),
        }
    }
}

/// Where packages are kept.
#[derive(Clone, Debug)]
pub enum StoreConfig {
    /// A folder, for one server alone.
    Local(PathBuf),
    /// A bucket of an S3-compatible store, for any number of servers. What an upload leaves there when its server dies
    /// is invisible, but a rule of the bucket's should remove incomplete multipart uploads. Credentials come from the environment's `AWS_ACCESS_KEY_ID`,
    /// `AWS_SECRET_ACCESS_KEY` and their kin.
    #[cfg(feature = "s3")]
    S3 {
        /// The bucket, which must exist.
        bucket: String,
        /// The store's address, unless it is Amazon's: `https://HOST[:PORT]`.
        endpoint: Option<String>,
        /// The bucket's region; `us-east-1` if none is given.
        region: Option<String>,
    },
}

/// Every bound a server keeps, so that no client makes it grow. Read from a file, each has to be in its range: what would serve nobody is refused.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Bytes of the largest package.
    #[serde(deserialize_with = "whole::<1, MAX_PACKAGE_BYTES, _, _>")]
    pub package_bytes: u64,
    /// The folder of uploads until they are checked; they have no name there and vanish with the process. `None`: in the
    /// local store's folder, or the system's folder for temporary files.
    pub spool: Option<PathBuf>,
    /// Uploads received at once. One owner gets no more of these places than it leaves free for others; who gets none for eight seconds is
    /// answered 503 with `Retry-After`.
    #[serde(deserialize_with = "whole::<1, 1024, _, _>")]
    pub uploads_at_once: usize,
    /// Packages checked at once; owners take turns. A check unpacks the package: at most 1 GiB each, by the reader's own bounds.
    #[serde(deserialize_with = "whole::<1, 64, _, _>")]
    pub checks_at_once: usize,
    /// Packages that one owner may have. Several instances that share a store may each let one more through.
    #[serde(deserialize_with = "whole::<1, 10_000, _, _>")]
    pub packages_per_owner: usize,
    /// Bytes that these may have together; each owner's count in full, also where another one has put the same.
    #[serde(deserialize_with = "whole::<1, { 1 << 50 }, _, _>")]
    pub bytes_per_owner: u64,
    /// Bytes that all packages in the local store may have together. A bucket's are its provider's to bound.
    #[serde(deserialize_with = "whole::<1, { 1 << 50 }, _, _>")]
    pub store_bytes: u64,
    /// Bytes that stay free on the disks of the local store and of the spool; of a small disk a tenth.
    #[serde(deserialize_with = "whole::<0, { 1 << 50 }, _, _>")]
    pub disk_reserve: u64,
    /// Requests a second that one address may make in the long run; 0 lifts the limit. The address is the connection's, or, behind a proxy, the
    /// last one in `X-Forwarded-For`. IPv6 addresses count by their /56.
    #[serde(deserialize_with = "whole::<0, 1_000_000, _, _>")]
    pub requests_per_second: u32,
    /// All connections come from a proxy, which adds the client's address to `X-Forwarded-For`. They are not counted by address then, and nobody else may
    /// be let through to this server: whoever was could say any address.
    pub behind_proxy: bool,
    /// Requests that one address may make at once.
    #[serde(deserialize_with = "whole::<1, 1_000_000, _, _>")]
    pub request_burst: u32,
    /// Connections at once, from everywhere.
    #[serde(deserialize_with = "whole::<1, 1_000_000, _, _>")]
    pub connections: usize,
    /// Connections at once from one address (IPv6: from one /56).
    #[serde(deserialize_with = "whole::<1, 1_000_000, _, _>")]
    pub connections_per_address: usize,
    /// Rooms whose senders are connected to this instance.
    #[serde(deserialize_with = "whole::<1, 1_000_000, _, _>")]
    pub rooms: usize,
    /// The same, of one owner.
    #[serde(deserialize_with = "whole::<1, 1_000_000, _, _>")]
    pub rooms_per_owner: usize,
    /// Viewers of one room that wait for an answer.
    #[serde(deserialize_with = "whole::<1, 1024, _, _>")]
    pub waiting_per_room: usize,
    /// Bytes of an SDP offer or answer.
    #[serde(deserialize_with = "whole::<1024, { 1 << 20 }, _, _>")]
    pub sdp_bytes: usize,
    /// The longest that a room's tokens may be valid.
    #[serde(deserialize_with = "seconds::<60_000, 315_360_000, _>")]
    pub room_lifetime: Duration,
    /// How long a sender may take to answer an offer.
    #[serde(deserialize_with = "seconds::<100, 60, _>")]
    pub answer_within: Duration,
    /// How long a client may take to send a request's head; also how long an idle connection is kept.
    #[serde(deserialize_with = "seconds::<100, 600, _>")]
    pub head_within: Duration,
    /// How long any request may take, but for presence, uploads and downloads.
    #[serde(deserialize_with = "seconds::<100, 600, _>")]
    pub request_within: Duration,
    /// How long an upload may pause, and how long a client may leave what was sent to it unread.
    #[serde(deserialize_with = "seconds::<100, 600, _>")]
    pub pause: Duration,
    /// How long an upload may take altogether.
    #[serde(deserialize_with = "seconds::<1000, 86_400, _>")]
    pub upload_within: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            package_bytes: 128 << 20,
            spool: None,
            uploads_at_once: 16,
            checks_at_once: 1,
            packages_per_owner: 200,
            bytes_per_owner: 4 << 30,
            store_bytes: 64 << 30,
            disk_reserve: 1 << 30,
            requests_per_second: 50,
            behind_proxy: false,
            request_burst: 500,
            connections: 4096,
            connections_per_address: 512,
            rooms: 1024,
            rooms_per_owner: 64,
            waiting_per_room: 32,
            sdp_bytes: MAX_SDP_BYTES,
            room_lifetime: Duration::from_secs(30 * 86400),
            answer_within: ANSWER_WITHIN,
            head_within: Duration::from_secs(10),
            request_within: Duration::from_secs(15),
            pause: Duration::from_secs(20),
            upload_within: Duration::from_secs(900),
        }
    }
}
