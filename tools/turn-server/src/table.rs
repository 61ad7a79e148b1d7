//! The allocations of a server, and how many each may have.

use crate::allocation::{Allocation, Client};
use crate::config::Limits;
use crate::credentials::Role;
use crate::holder::{Holder, Token};
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
    of_room: HashMap<String, usize>,
    /// Of a room's, those that are not its sender's.
    of_viewers: HashMap<String, usize>,
    of_token: HashMap<Token, usize>,
    of_token_and_address: HashMap<(Token, IpAddr), usize>,
    of_owner: HashMap<String, usize>,
    of_address: HashMap<IpAddr, usize>,
    /// By the IP address that was lent.
    of_lent: HashMap<IpAddr, usize>,
    limits: Limits,
}

/// Which bound an allocation would break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Full {
    Server,
    Owner,
    Room,
    Token,
    Address,
}

impl fmt::Display for Full {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Server => "the server has as many as it may",
            Self::Owner => "its room's owner has as many as are left free",
            Self::Room => "its room has as many as it may",
            Self::Token => "its token has as many as it may, from its address or in all",
            Self::Address => "its address has as many as it may",
        })
    }
}

impl Table {
    pub(crate) fn new(limits: &Limits) -> Self {
        Self {
            by_client: HashMap::new(),
            by_lent: HashMap::new(),
            of_room: HashMap::new(),
            of_viewers: HashMap::new(),
            of_token: HashMap::new(),
            of_token_and_address: HashMap::new(),
            of_owner: HashMap::new(),
            of_address: HashMap::new(),
            of_lent: HashMap::new(),
            limits: limits.clone(),
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

    pub(crate) fn len(&self) -> usize {
        self.by_client.len()
    }

    /// Whether there is room for one more.
    pub(crate) fn has_room(&self, client: &Client, holder: &Holder) -> Result<(), Full> {
        let limits = &self.limits;
        let address = network_prefix(client.address.ip());
        let free = limits.allocations.saturating_sub(self.by_client.len());
        if free == 0 {
            return Err(Full::Server);
        }
        // No more than are left to other owners, where it is known whose the room is.
        if !holder.owner.is_empty() && count(&self.of_owner, &holder.owner) >= free {
            return Err(Full::Owner);
        }
        if count(&self.of_room, &holder.room) >= limits.allocations_per_room {
            return Err(Full::Room);
        }
        if holder.role != Role::Sender {
            let viewers =
                (limits.allocations_per_room).saturating_sub(limits.allocations_of_sender);
            if count(&self.of_viewers, &holder.room) >= viewers {
                return Err(Full::Room);
            }
            let connections = if holder.role == Role::Member { 4 } else { 1 };
            let here = (holder.token.clone(), address);
            if count(&self.of_token, &holder.token) >= limits.allocations_per_token
                || count(&self.of_token_and_address, &here)
                    >= connections * limits.allocations_per_token_and_address
            {
                return Err(Full::Token);
            }
        }
        if count(&self.of_address, &address) >= limits.allocations_per_address {
            return Err(Full::Address);
        }
        Ok(())
    }

    /// Takes an allocation in. Its client has no other, and no other was lent its address.
    pub(crate) fn insert(&mut self, allocation: Arc<Allocation>) -> Result<(), Full> {
        let terms = &allocation.terms;
        self.has_room(&terms.client, &terms.holder)?;
        let address = network_prefix(terms.client.address.ip());
        let holder = terms.holder.clone();
        *self.of_address.entry(address).or_default() += 1;
        *self.of_lent.entry(terms.relayed.ip()).or_default() += 1;
        if holder.role != Role::Sender {
            *self.of_viewers.entry(holder.room.clone()).or_default() += 1;
            *self.of_token.entry(holder.token.clone()).or_default() += 1;
            let here = (holder.token, address);
            *self.of_token_and_address.entry(here).or_default() += 1;
        }
        *self.of_room.entry(holder.room).or_default() += 1;
        *self.of_owner.entry(holder.owner).or_default() += 1;
        self.by_lent.insert(terms.relayed, Arc::clone(&allocation));
        self.by_client.insert(terms.client, allocation);
        Ok(())
    }

    /// Removes an allocation, if it is still there.
    pub(crate) fn remove(&mut self, allocation: &Allocation) {
        let terms = &allocation.terms;
        let found = self.by_lent.get(&terms.relayed);
        if !found.is_some_and(|found| std::ptr::eq(&raw const **found, allocation)) {
            return;
        }
        self.by_lent.remove(&terms.relayed);
        self.by_client.remove(&terms.client);
        let address = network_prefix(terms.client.address.ip());
        let holder = &terms.holder;
        one_less(&mut self.of_address, &address);
        one_less(&mut self.of_lent, &terms.relayed.ip());
        if holder.role != Role::Sender {
            one_less(&mut self.of_viewers, &holder.room);
            one_less(&mut self.of_token, &holder.token);
            let here = (holder.token.clone(), address);
            one_less(&mut self.of_token_and_address, &here);
        }
        one_less(&mut self.of_room, &holder.room);
        one_less(&mut self.of_owner, &holder.owner);
    }
}

fn count<K: Hash + Eq>(counts: &HashMap<K, usize>, key: &K) -> usize {
    counts.get(key).copied().unwrap_or_default()
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

/// The address that limits count by: an IPv6 address's /56, which providers give to one customer (RIPE-690), with 256
/// networks (/64) in it.
#[must_use]
pub fn network_prefix(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(v6) => IpAddr::V6(Ipv6Addr::from_bits(v6.to_bits() & !(u128::MAX >> 56))),
        v4 => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_networks_of_one_customer_count_as_one_address() {
        let prefix = |text: &str| network_prefix(text.parse().expect("an address")).to_string();
        assert_eq!(prefix("2001:db8:1:2::7"), "2001:db8:1::");
        assert_eq!(prefix("2001:db8:1:ff:8000::1"), "2001:db8:1::");
        assert_eq!(prefix("2001:db8:1:100::"), "2001:db8:1:100::");
        assert_eq!(prefix("::ffff:192.0.2.1"), "192.0.2.1");
        assert_eq!(prefix("192.0.2.1"), "192.0.2.1");
    }
}
