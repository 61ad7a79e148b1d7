//! How many answers requests without valid credentials get: so many of one address, and so many in all. Such requests
//! may have forged senders.

use crate::budget::Budget;
use crate::config::Limits;
use crate::table::network_prefix;
use std::collections::HashMap;
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// How long an address that has used up its answers takes to have all of them again.
const ROOM: Duration = Duration::from_secs(5);

/// Addresses that are counted at once. Where there are more, as with forged ones, the newcomers share the bound in all.
const ADDRESSES: usize = 16_384;
/// How often those that ask no longer are forgotten at most.
const FORGET_EVERY: Duration = Duration::from_secs(1);

/// The answers that are left.
#[derive(Debug)]
pub(crate) struct Strangers {
    per_address: u64,
    in_all: Budget,
    of_address: HashMap<IpAddr, Budget>,
    forgotten: Instant,
}

impl Strangers {
    pub(crate) fn new(limits: &Limits, now: Instant) -> Self {
        Self {
            per_address: limits.unauthenticated_per_address,
            in_all: Budget::new(limits.unauthenticated_per_second, now),
            of_address: HashMap::new(),
            forgotten: now,
        }
    }

    /// Takes one answer for `address`, if there is one.
    pub(crate) fn take(&mut self, address: IpAddr, now: Instant) -> bool {
        let address = network_prefix(address);
        let is_full = self.of_address.len() >= ADDRESSES;
        if is_full && now.saturating_duration_since(self.forgotten) >= FORGET_EVERY {
            self.of_address.retain(|_, budget| !budget.is_full(now));
            self.forgotten = now;
        }
        // What an address has no answers for takes none from the others.
        if self.of_address.len() < ADDRESSES || self.of_address.contains_key(&address) {
            let new = || Budget::with_room(self.per_address, ROOM, now);
            let budget = self.of_address.entry(address).or_insert_with(new);
            if !budget.take(1, now) {
                return false;
            }
        }
        self.in_all.take(1, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    #[test]
    fn an_address_uses_up_its_own_answers_and_no_table_grows_without_bound() {
        let begin = Instant::now();
        let limits = Limits::default();
        let mut strangers = Strangers::new(&limits, begin);
        let address = |number: u32| IpAddr::V4(Ipv4Addr::from_bits(0x0100_0000 + number));
        let answers = (0..100_000)
            .filter(|_| strangers.take(address(0), begin))
            .count();
        assert_eq!(answers, 100, "five seconds' worth");
        assert!(strangers.take(address(1), begin), "another address");
        let later = begin + Duration::from_secs(1);
        let answers = (0..1000)
            .filter(|_| strangers.take(address(0), later))
            .count();
        assert_eq!(answers, 20, "a second later");
        for number in 0..40_000 {
            strangers.take(address(number), later);
        }
        assert_eq!(strangers.of_address.len(), ADDRESSES);
        let quiet = later + Duration::from_secs(10);
        assert!(strangers.take(address(50_000), quiet));
        assert_eq!(strangers.of_address.len(), 1, "the others ask no longer");
    }
}
