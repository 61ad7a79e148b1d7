//! The allocations of a server, and how many each may have.

use crate::allocation::{Allocation, Client};
use crate::config::Limits;
use std::borrow::Borrow;
use std::collections::HashMap;
use std::fmt;
use std::hash::Hash;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::Arc;

/// The allocations.
#[derive(Debug)]
pub(crate) struct Table {
    by_client: HashMap<Client, Arc<Allocation>>,
    by_lent: HashMap<SocketAddr, Arc<Allocation>>,
    of_subject: HashMap<String, usize>,
    of_address: HashMap<IpAddr, usize>,
    /// By the IP address that was lent.
    of_lent: HashMap<IpAddr, usize>,
    limit: usize,
    per_subject: usize,
    per_address: usize,
}

/// Which bound an allocation would break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Full {
    Server,
    Subject,
    Address,
}

impl fmt::Display for Full {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Server => "the server has as many as it may",
            Self::Subject => "its room has as many as it may",
            Self::Address => "its address has as many as it may",
        })
    }
}

impl Table {
    pub(crate) fn new(limits: &Limits) -> Self {
        Self {
            by_client: HashMap::new(),
            by_lent: HashMap::new(),
            of_subject: HashMap::new(),
            of_address: HashMap::new(),
            of_lent: HashMap::new(),
            limit: limits.allocations,
            per_subject: limits.allocations_per_subject,
            per_address: limits.allocations_per_address,
        }
    }

    pub(crate) fn get(&self, client: &Client) -> Option<Arc<Allocation>> {
        self.by_client.get(client).cloned()
    }

    /// The allocation that was lent this address.
    pub(crate) fn lent(&self, address: SocketAddr) -> Option<Arc<Allocation>> {
        self.by_lent.get(&address).cloned()
    }

    /// Whether any allocation was lent an address of this IP address.
    pub(crate) fn lends(&self, ip: IpAddr) -> bool {
        self.of_lent.contains_key(&ip)
    }

    pub(crate) fn all(&self) -> impl Iterator<Item = &Arc<Allocation>> {
        self.by_client.values()
    }

    /// Whether there is room for one more.
    pub(crate) fn has_room(&self, client: &Client, subject: &str) -> Result<(), Full> {
        let prefix = network_prefix(client.address.ip());
        let subjects = self.of_subject.get(subject).copied().unwrap_or(0);
        let addresses = self.of_address.get(&prefix).copied().unwrap_or(0);
        if self.by_client.len() >= self.limit {
            return Err(Full::Server);
        }
        if subjects >= self.per_subject {
            return Err(Full::Subject);
        }
        if addresses >= self.per_address {
            return Err(Full::Address);
        }
        Ok(())
    }

    /// Takes an allocation in. Its client has no other, and no other was lent its address.
    pub(crate) fn insert(&mut self, allocation: Arc<Allocation>) -> Result<(), Full> {
        self.has_room(&allocation.terms.client, &allocation.terms.subject)?;
        let prefix = network_prefix(allocation.terms.client.address.ip());
        *self
            .of_subject
            .entry(allocation.terms.subject.clone())
            .or_default() += 1;
        *self.of_address.entry(prefix).or_default() += 1;
        *self
            .of_lent
            .entry(allocation.terms.relayed.ip())
            .or_default() += 1;
        self.by_lent
            .insert(allocation.terms.relayed, Arc::clone(&allocation));
        self.by_client.insert(allocation.terms.client, allocation);
        Ok(())
    }

    /// Removes an allocation, if it is still there.
    pub(crate) fn remove(&mut self, allocation: &Allocation) {
        let found = self.by_lent.get(&allocation.terms.relayed);
        if !found.is_some_and(|found| std::ptr::eq(&raw const **found, allocation)) {
            return;
        }
        self.by_lent.remove(&allocation.terms.relayed);
        self.by_client.remove(&allocation.terms.client);
        one_less(&mut self.of_subject, &allocation.terms.subject);
        one_less(&mut self.of_lent, &allocation.terms.relayed.ip());
        one_less(
            &mut self.of_address,
            &network_prefix(allocation.terms.client.address.ip()),
        );
    }
}

fn one_less<K, Q>(counts: &mut HashMap<K, usize>, key: &Q)
where
    K: Hash + Eq + Borrow<Q>,
    Q: Hash + Eq + ?Sized,
{
    if let Some(count) = counts.get_mut(key) {
        *count -= 1;
        if *count == 0 {
            counts.remove(key);
        }
    }
}

/// The address that limits count by: an IPv6 address's /64, all of which belong to one client.
#[must_use]
pub fn network_prefix(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(v6) => IpAddr::V6(Ipv6Addr::from_bits(v6.to_bits() & !u128::from(u64::MAX))),
        v4 => v4,
    }
}
