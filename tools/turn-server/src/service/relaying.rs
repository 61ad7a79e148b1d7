//! Passing on: from a client to its peers, and from them to the client, where the client permitted it and the rate allows it.

use super::refusal::{FORBIDDEN, PEER_FAMILY, Refusal};
use super::{MAX_PACKET, Service, lock};
use crate::allocation::{Allocation, Client, Side};
use crate::message::{Message, attribute};
use crate::peers::Reach;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

impl Service {
    /// Where packets from `allocation` to `peer` would go, if they may.
    pub(super) fn side_of(
        &self,
        allocation: &Allocation,
        peer: SocketAddr,
    ) -> Result<Side, Refusal> {
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

    pub(super) fn send_indication(&self, client: Client, message: &Message<'_>) {
        let peer = message.peers().next().flatten();
        let data = message.get(attribute::DATA);
        if let Some((peer, data)) = peer.zip(data)
            && let Some(allocation) = self.allocation(client)
        {
            self.relay_out(&allocation, peer, data);
        }
    }

    pub(super) fn channel_data(&self, client: Client, packet: &[u8]) {
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
}

/// Hands what arrives at the lent address to the client, until the allocation ends.
pub(super) async fn relay(service: Arc<Service>, allocation: Arc<Allocation>) {
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
