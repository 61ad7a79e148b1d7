//! What the relay counts by itself, as it is when someone asks.

use prometheus_client::encoding::{EncodeLabelSet, EncodeLabelValue};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use std::sync::atomic::Ordering::Relaxed;
use turn_server::Counts;

/// Which bound an allocation would have broken, or why a request was not served.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq, EncodeLabelValue)]
enum Reason {
    Server,
    Owner,
    Room,
    Token,
    Address,
    Revoked,
    Unanswered,
    Connections,
    Blocked,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Refused {
    reason: Reason,
}

/// The relay's counters.
#[derive(Debug)]
pub(super) struct Relay {
    allocations: Gauge,
    refused: Family<Refused, Counter>,
}

impl Relay {
    pub(super) fn registered(registry: &mut Registry) -> Self {
        let (allocations, refused) = (Gauge::default(), Family::default());
        registry.register(
            "relay_allocations",
            "Addresses that the relay lends now",
            allocations.clone(),
        );
        registry.register(
            "relay_refused",
            "Allocations, requests, packets and connections that the relay refused, by reason",
            refused.clone(),
        );
        Self {
            allocations,
            refused,
        }
    }

    pub(super) fn set(&self, counts: Counts) {
        let allocations = i64::try_from(counts.allocations).unwrap_or(i64::MAX);
        self.allocations.set(allocations);
        for (reason, count) in [
            (Reason::Server, counts.refused_by_server),
            (Reason::Owner, counts.refused_by_owner),
            (Reason::Room, counts.refused_by_room),
            (Reason::Token, counts.refused_by_token),
            (Reason::Address, counts.refused_by_address),
            (Reason::Revoked, counts.revoked),
            (Reason::Unanswered, counts.unanswered),
            (Reason::Connections, counts.connections_refused),
            (Reason::Blocked, counts.blocked),
        ] {
            let counter = self.refused.get_or_create(&Refused { reason });
            counter.inner().store(count, Relaxed);
        }
    }
}
