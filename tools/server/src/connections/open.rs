//! Which connections are open, and which one is closed in favour of a new one where there are as many as there may be.
//!
//! A connection is *trusted* once a request on it has succeeded with a valid token. A part of the places is kept for
//! trusted connections, and as large a part for the others. Within each kind the address with the most connections
//! gives one up, the one that has been idle for longest: so an address that opens many loses its own first.

use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use tokio_util::sync::CancellationToken;
use turn_server::network_prefix;

/// Places that are kept for trusted connections, and for those that are not; of few places in all, a quarter.
const KEPT: usize = 256;

/// The connections that are open, by the numbers that they get here.
#[derive(Debug)]
pub(super) struct Open {
    most: usize,
    per_address: usize,
    connections: HashMap<u64, Connection>,
    by_client: HashMap<SocketAddr, u64>,
    by_address: HashMap<IpAddr, Count>,
    trusted: usize,
    next: u64,
}

#[derive(Debug)]
struct Connection {
    client: SocketAddr,
    place: Place,
    is_trusted: bool,
}

/// The connections of one address.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    trusted: usize,
    others: usize,
}

impl Count {
    fn of(&mut self, is_trusted: bool) -> &mut usize {
        if is_trusted {
            &mut self.trusted
        } else {
            &mut self.others
        }
    }

    fn all(self) -> usize {
        self.trusted + self.others
    }
}

/// What a connection and this table share.
#[derive(Clone, Debug, Default)]
pub(super) struct Place {
    pub(super) number: u64,
    /// The connection ends.
    pub(super) closed: CancellationToken,
    /// When bytes passed last, milliseconds since the server's start.
    pub(super) used: Arc<AtomicU64>,
}

/// Too many connections, and none that is closed for this one.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Full;

/// A new connection's place, and how many others were closed for it.
#[derive(Debug)]
pub(super) struct Entered {
    pub(super) place: Place,
    pub(super) has_replaced: bool,
}

impl Open {
    pub(super) fn new(most: usize, per_address: usize) -> Self {
        Self {
            most,
            per_address,
            connections: HashMap::new(),
            by_client: HashMap::new(),
            by_address: HashMap::new(),
            trusted: 0,
            next: 0,
        }
    }

    /// Places that each kind of connections has for itself.
    fn kept(&self) -> usize {
        KEPT.min(self.most / 4)
    }

    /// Takes a connection of `client` in at `now` (milliseconds), in place of another one if need be.
    pub(super) fn enter(&mut self, client: SocketAddr, now: u64) -> Result<Entered, Full> {
        let address = network_prefix(client.ip());
        let here = self.by_address.get(&address).copied().unwrap_or_default();
        if here.all() >= self.per_address {
            return Err(Full);
        }
        let others = self.connections.len() - self.trusted;
        let is_full = self.connections.len() >= self.most || others >= self.most - self.kept();
        if is_full {
            // Among trusted ones only where they have taken more than is left to them.
            let victim = self.victim(others == 0 || others < self.kept());
            self.close(victim.ok_or(Full)?);
        }
        let place = Place {
            number: self.next,
            closed: CancellationToken::new(),
            used: Arc::new(AtomicU64::new(now)),
        };
        self.next += 1;
        self.by_address.entry(address).or_default().others += 1;
        self.by_client.insert(client, place.number);
        let connection = Connection {
            client,
            place: place.clone(),
            is_trusted: false,
        };
        self.connections.insert(place.number, connection);
        Ok(Entered {
            place,
            has_replaced: is_full,
        })
    }

    /// Of the connections of this kind one of the address with the most, the one that has been idle for longest.
    fn victim(&self, is_trusted: bool) -> Option<u64> {
        let of_kind = self.connections.values();
        let of_kind = of_kind.filter(|connection| connection.is_trusted == is_trusted);
        let first = of_kind.min_by_key(|connection| {
            let address = network_prefix(connection.client.ip());
            let count = self.by_address.get(&address).copied().unwrap_or_default();
            let count = if is_trusted {
                count.trusted
            } else {
                count.others
            };
            let used = connection.place.used.load(Relaxed);
            (std::cmp::Reverse(count), used)
        });
        first.map(|connection| connection.place.number)
    }

    /// A request of this client has succeeded with a valid token.
    pub(super) fn trust(&mut self, client: &SocketAddr) {
        // The places of untrusted connections stay theirs.
        if self.trusted >= self.most - self.kept() {
            return;
        }
        let number = self.by_client.get(client);
        let Some(connection) = number.and_then(|number| self.connections.get_mut(number)) else {
            return;
        };
        if !connection.is_trusted {
            connection.is_trusted = true;
            self.trusted += 1;
            let address = network_prefix(client.ip());
            let count = self.by_address.entry(address).or_default();
            count.others = count.others.saturating_sub(1);
            count.trusted += 1;
        }
    }

    /// Closes those whose clients `is_closed` says.
    pub(super) fn close_those(&mut self, is_closed: impl Fn(IpAddr) -> bool) {
        let closed = self.connections.values();
        let closed = closed.filter(|connection| is_closed(connection.client.ip()));
        let closed: Vec<u64> = closed.map(|connection| connection.place.number).collect();
        for number in closed {
            self.close(number);
        }
    }

    fn close(&mut self, number: u64) {
        if let Some(place) = self.leave(number) {
            place.closed.cancel();
        }
    }

    /// Takes a connection out, if it is still there.
    pub(super) fn leave(&mut self, number: u64) -> Option<Place> {
        let Connection {
            client,
            place,
            is_trusted,
        } = self.connections.remove(&number)?;
        self.trusted -= usize::from(is_trusted);
        if self.by_client.get(&client) == Some(&number) {
            self.by_client.remove(&client);
        }
        let address = network_prefix(client.ip());
        if let Some(count) = self.by_address.get_mut(&address) {
            let of_kind = count.of(is_trusted);
            *of_kind = of_kind.saturating_sub(1);
            if count.all() == 0 {
                self.by_address.remove(&address);
            }
        }
        Some(place)
    }

    pub(super) fn len(&self) -> usize {
        self.connections.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(address: u8, port: u16) -> SocketAddr {
        SocketAddr::from(([192, 0, 2, address], port))
    }

    fn enter(open: &mut Open, address: u8, port: u16, now: u64) -> Place {
        let entered = open.enter(client(address, port), now);
        entered.expect("a place").place
    }

    #[test]
    fn the_address_with_the_most_gives_up_the_one_that_was_idle_for_longest() {
        let mut open = Open::new(16, 8);
        let many: Vec<_> = (0..8)
            .map(|i| enter(&mut open, 1, i, u64::from(i)))
            .collect();
        let few: Vec<_> = (0..4).map(|i| enter(&mut open, 2, i, 0)).collect();
        assert_eq!(
            open.enter(client(1, 9), 20).err(),
            Some(Full),
            "of one address"
        );
        // A quarter is kept for trusted ones: these are as many as there may be.
        many[0].used.store(9, Relaxed);
        let entered = open.enter(client(3, 1), 20).expect("in place of another");
        assert!(entered.has_replaced && many[1].closed.is_cancelled());
        let closed = many
            .iter()
            .chain(&few)
            .filter(|place| place.closed.is_cancelled());
        assert_eq!(closed.count(), 1);
        assert_eq!(open.len(), 12);
        assert!(open.leave(many[1].number).is_none(), "gone already");
        for place in many.iter().chain(&few).chain([&entered.place]) {
            open.leave(place.number);
        }
        let empty = (
            open.len(),
            open.by_client.len(),
            open.by_address.len(),
            open.trusted,
        );
        assert_eq!(empty, (0, 0, 0, 0), "nothing is left");
    }

    #[test]
    fn trusted_connections_stay_while_others_come_and_leave_some_places_to_them() {
        let mut open = Open::new(16, 16);
        let trusted: Vec<_> = (0..4).map(|i| enter(&mut open, 1, i, 0)).collect();
        (0..4).for_each(|i| open.trust(&client(1, i)));
        for number in 0..100_u8 {
            enter(&mut open, 2 + number % 50, number.into(), number.into());
        }
        assert!(!trusted.iter().any(|place| place.closed.is_cancelled()));
        assert_eq!(open.len(), 16);
        // Of one address with a token no more than its kind may have: an honest newcomer has a place, and keeps it.
        let mut open = Open::new(16, 100);
        for port in 0..16 {
            enter(&mut open, 1, port, 0);
            open.trust(&client(1, port));
        }
        assert_eq!(open.trusted, 12);
        let newcomer = enter(&mut open, 2, 1, 1);
        for port in 100..120 {
            enter(&mut open, 1, port, 2);
            open.trust(&client(1, port));
        }
        assert!(
            !newcomer.closed.is_cancelled(),
            "others of the address went"
        );
    }

    #[test]
    fn connections_of_a_blocked_address_are_closed() {
        let mut open = Open::new(16, 16);
        let places = [1, 2].map(|address| enter(&mut open, address, 1, 0));
        open.close_those(|ip| ip == client(1, 1).ip());
        assert_eq!(
            places.map(|place| place.closed.is_cancelled()),
            [true, false]
        );
    }
}
