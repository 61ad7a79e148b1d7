//! The TCP connections that are open: so many in all, and of one address. Where there are as many as there may be, the
//! address with the most loses its oldest connection without an allocation to a new one.

use crate::config::Limits;
use crate::table::network_prefix;
use std::cmp::Reverse;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio_util::sync::CancellationToken;

/// The connections. Clones share them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Connections(Arc<Mutex<Open>>);

#[derive(Debug, Default)]
struct Open {
    /// By their numbers, which grow.
    connections: HashMap<u64, (IpAddr, Kept)>,
    by_address: HashMap<IpAddr, usize>,
}

/// What a connection and the table share.
#[derive(Debug, Clone, Default)]
struct Kept {
    has_allocation: Arc<AtomicBool>,
    closed: CancellationToken,
}

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    connections: Connections,
    number: u64,
    kept: Kept,
}

impl Connections {
    /// A place for the connection of this number, which is greater than those before. Nothing where there are too many.
    pub(crate) fn enter(&self, number: u64, ip: IpAddr, limits: &Limits) -> Option<Place> {
        let address = network_prefix(ip);
        let mut open = self.locked();
        let here = open.by_address.get(&address).copied().unwrap_or(0);
        if here >= limits.connections_per_address {
            return None;
        }
        if open.connections.len() >= limits.connections {
            let victim = open.victim()?;
            if let Some(kept) = open.leave(victim) {
                kept.closed.cancel();
            }
        }
        let kept = Kept::default();
        *open.by_address.entry(address).or_default() += 1;
        open.connections.insert(number, (address, kept.clone()));
        Some(Place {
            connections: self.clone(),
            number,
            kept,
        })
    }

    fn locked(&self) -> MutexGuard<'_, Open> {
        // Nothing in there is left half done.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    fn victim(&self) -> Option<u64> {
        let idle = self.connections.iter();
        let idle = idle.filter(|(_, (_, kept))| !kept.has_allocation.load(Relaxed));
        let first = idle
            .min_by_key(|(number, (address, _))| (Reverse(self.by_address.get(address)), **number));
        first.map(|(number, _)| *number)
    }

    /// Takes a connection out, if it is still there.
    fn leave(&mut self, number: u64) -> Option<Kept> {
        let (address, kept) = self.connections.remove(&number)?;
        if let Some(count) = self.by_address.get_mut(&address) {
            *count -= 1;
            if *count == 0 {
                self.by_address.remove(&address);
            }
        }
        Some(kept)
    }
}

impl Place {
    /// Says whether the connection's client has an allocation: then it is not closed for another one.
    pub(crate) fn has_allocation(&self, has: bool) {
        self.kept.has_allocation.store(has, Relaxed);
    }

    /// Waits until the connection is closed for another one.
    pub(crate) async fn closed(&self) {
        self.kept.closed.cancelled().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.connections.locked().leave(self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    #[test]
    fn the_address_with_the_most_loses_its_oldest_connection_without_an_allocation() {
        let limits = Limits {
            connections: 6,
            connections_per_address: 4,
            ..Limits::default()
        };
        let connections = Connections::default();
        let enter = |number, address| {
            let ip = Ipv4Addr::new(192, 0, 2, address).into();
            connections.enter(number, ip, &limits)
        };
        let places: Vec<_> = [1, 1, 1, 1, 2, 2].iter().zip(0..).collect();
        let places: Vec<_> = places
            .iter()
            .map(|(a, n)| enter(*n, **a).expect("room"))
            .collect();
        assert!(enter(9, 1).is_none(), "of one address");
        places[0].has_allocation(true);
        let newcomer = enter(10, 3).expect("in place of another");
        let closed = |place: &Place| place.kept.closed.is_cancelled();
        let all: Vec<_> = places.iter().map(closed).collect();
        assert_eq!(all, [false, true, false, false, false, false]);
        for place in &places {
            place.has_allocation(true);
        }
        newcomer.has_allocation(true);
        assert!(enter(11, 4).is_none(), "all of them are in use");
        drop((places, newcomer));
        let open = connections.locked();
        assert_eq!((open.connections.len(), open.by_address.len()), (0, 0));
    }
}
