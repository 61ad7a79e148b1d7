//! One call's pair of UDP sockets. The viewer sends to one of them as if it were the sender; the sender likewise to the other.
//!
//! Each side's true address is first what its session description said, then where its packets come from. A side may speak from
//! several addresses at once while ICE tries them; the first to speak is kept as long as it speaks, or answers would be misrouted.

use std::{
    io,
    net::{IpAddr, SocketAddr},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use tokio::{net::UdpSocket, task::JoinSet};

use crate::{
    Impairment,
    link::{Fate, Link},
    pacer::{Pacer, locked},
    statistics::{DirectionStatistics, IP_UDP_HEADERS, Statistics},
};

/// After a silence this long a side may continue from another address.
const ADDRESS_KEPT: Duration = Duration::from_secs(1);

/// A direction through the lab.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the sender to the viewer, as motion goes.
    Down,
    /// From the viewer to the sender.
    Up,
}

impl Direction {
    pub(crate) fn of(self, statistics: &mut Statistics) -> &mut DirectionStatistics {
        match self {
            Self::Down => &mut statistics.down,
            Self::Up => &mut statistics.up,
        }
    }
}

#[derive(Debug)]
struct Side {
    /// The same socket twice: the runtime's for receiving, the system's for sending from the pacer's thread.
    receiving: UdpSocket,
    sending: std::net::UdpSocket,
    address: SocketAddr,
    peer: Mutex<Peer>,
}

#[derive(Debug, Default)]
struct Peer {
    described: Option<SocketAddr>,
    heard: Option<(SocketAddr, Duration)>,
}

impl Side {
    fn open(ip: IpAddr) -> io::Result<Self> {
        let sending = std::net::UdpSocket::bind((ip, 0))?;
        sending.set_nonblocking(true)?;
        let address = sending.local_addr()?;
        Ok(Self {
            receiving: UdpSocket::from_std(sending.try_clone()?)?,
            sending,
            address,
            peer: Mutex::default(),
        })
    }

    /// Whether a packet's source is the side's peer, which it becomes if there is none.
    fn knows(&self, source: SocketAddr, now: Duration) -> bool {
        let mut peer = locked(&self.peer);
        let is_known = peer
            .heard
            .is_none_or(|(known, last)| known == source || now.saturating_sub(last) > ADDRESS_KEPT);
        if is_known {
            peer.heard = Some((source, now));
        }
        is_known
    }

    fn target(&self) -> Option<SocketAddr> {
        let peer = locked(&self.peer);
        peer.heard.map(|(address, _)| address).or(peer.described)
    }
}

#[derive(Debug)]
struct Way {
    link: Mutex<Link>,
    offered: AtomicU64,
    /// One more than the index of the newest packet delivered.
    newest: AtomicU64,
}

impl Way {
    fn new(impairment: Impairment, seed: u64, now: Duration) -> Self {
        Self {
            link: Mutex::new(Link::new(impairment, seed, now)),
            offered: AtomicU64::new(0),
            newest: AtomicU64::new(0),
        }
    }
}

/// One call through the lab.
#[derive(Debug)]
pub(crate) struct Relay {
    viewer: Side,
    sender: Side,
    down: Way,
    up: Way,
    statistics: Arc<Mutex<Statistics>>,
    last_heard: Mutex<Duration>,
}

/// The initial state of one call's relay.
pub(crate) struct RelayConfig {
    pub(crate) ip: IpAddr,
    pub(crate) down: Impairment,
    pub(crate) up: Impairment,
    pub(crate) down_seed: u64,
    pub(crate) up_seed: u64,
    /// When the impairments were put in place.
    pub(crate) down_epoch: Duration,
    pub(crate) up_epoch: Duration,
}

impl Relay {
    pub(crate) fn open(
        config: RelayConfig,
        pacer: &Pacer,
        statistics: Arc<Mutex<Statistics>>,
    ) -> io::Result<Self> {
        Ok(Self {
            viewer: Side::open(config.ip)?,
            sender: Side::open(config.ip)?,
            down: Way::new(config.down, config.down_seed, config.down_epoch),
            up: Way::new(config.up, config.up_seed, config.up_epoch),
            statistics,
            last_heard: Mutex::new(pacer.now()),
        })
    }

    /// Where the viewer finds the sender.
    pub(crate) fn viewer_facing(&self) -> SocketAddr {
        self.viewer.address
    }

    /// Where the sender finds the viewer.
    pub(crate) fn sender_facing(&self) -> SocketAddr {
        self.sender.address
    }

    pub(crate) fn set_viewer_address(&self, address: Option<SocketAddr>) {
        locked(&self.viewer.peer).described = address;
    }

    pub(crate) fn set_sender_address(&self, address: Option<SocketAddr>) {
        locked(&self.sender.peer).described = address;
    }

    pub(crate) fn set(&self, direction: Direction, impairment: Impairment, now: Duration) {
        let way = match direction {
            Direction::Down => &self.down,
            Direction::Up => &self.up,
        };
        locked(&way.link).set(impairment, now);
    }

    pub(crate) fn last_heard(&self) -> Duration {
        *locked(&self.last_heard)
    }

    /// Carries packets until it is dropped.
    pub(crate) async fn carry(self: Arc<Self>, pacer: Arc<Pacer>) {
        let mut directions = JoinSet::new();
        directions.spawn(self.clone().carry_one_way(Direction::Down, pacer.clone()));
        directions.spawn(self.carry_one_way(Direction::Up, pacer));
        while directions.join_next().await.is_some() {}
    }

    async fn carry_one_way(self: Arc<Self>, direction: Direction, pacer: Arc<Pacer>) {
        let from = match direction {
            Direction::Down => &self.sender,
            Direction::Up => &self.viewer,
        };
        let mut buffer = vec![0; 65_536];
        loop {
            match from.receiving.recv_from(&mut buffer).await {
                Ok((length, source)) => {
                    if let Some(datagram) = buffer.get(..length) {
                        self.take(direction, datagram, source, &pacer);
                    }
                }
                // An ICMP error about an earlier packet at most: the socket still works.
                Err(error) => {
                    log::debug!("netlab: receiving on {}: {error}", from.address);
                    tokio::task::yield_now().await;
                }
            }
        }
    }

    fn take(
        self: &Arc<Self>,
        direction: Direction,
        datagram: &[u8],
        source: SocketAddr,
        pacer: &Arc<Pacer>,
    ) {
        let now = pacer.now();
        let (from, way) = match direction {
            Direction::Down => (&self.sender, &self.down),
            Direction::Up => (&self.viewer, &self.up),
        };
        let mut statistics = locked(&self.statistics);
        if !from.knows(source, now) {
            statistics.strangers += 1;
            return;
        }
        *locked(&self.last_heard) = now;
        let bytes = datagram.len() as u64 + IP_UDP_HEADERS;
        let index = way.offered.fetch_add(1, Ordering::Relaxed);
        let (fate, backlog) = {
            let mut link = locked(&way.link);
            (link.offer(now, bytes), link.backlog(now))
        };
        let seen = direction.of(&mut statistics);
        seen.offer(now, bytes, backlog);
        let (at, copy_at) = match fate {
            Fate::Lost(cause) => return seen.lose(cause),
            Fate::Delivered { at, copy_at } => (at, copy_at),
        };
        drop(statistics);
        let datagram: Arc<[u8]> = datagram.into();
        for (at, is_copy) in [(Some(at), false), (copy_at, true)] {
            let Some(at) = at else { continue };
            let (relay, datagram) = (self.clone(), datagram.clone());
            pacer.at(at, move || {
                relay.deliver(direction, &datagram, index, at, is_copy);
            });
        }
    }

    fn deliver(
        &self,
        direction: Direction,
        datagram: &[u8],
        index: u64,
        now: Duration,
        is_copy: bool,
    ) {
        let (to, way) = match direction {
            Direction::Down => (&self.viewer, &self.down),
            Direction::Up => (&self.sender, &self.up),
        };
        let sent = to
            .target()
            .is_some_and(|target| match to.sending.send_to(datagram, target) {
                Ok(_) => true,
                Err(error) => {
                    log::debug!("netlab: sending to {target}: {error}");
                    false
                }
            });
        let newest = way.newest.fetch_max(index + 1, Ordering::Relaxed);
        let mut statistics = locked(&self.statistics);
        let seen = direction.of(&mut statistics);
        if !sent {
            // A copy that fails takes nothing away.
            seen.lost.undeliverable += u64::from(!is_copy);
            return;
        }
        seen.deliver(now, datagram.len() as u64 + IP_UDP_HEADERS);
        seen.duplicated += u64::from(is_copy);
        seen.reordered += u64::from(!is_copy && newest > index);
    }
}
