//! Counters by Prometheus' own library.

use super::relay::Relay;
use super::{OfferRefusal, TokenRefusal, UploadRefusal};
use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use std::hash::Hash;

/// A request's route (its pattern, not its path) and the answer's status.
#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Request {
    route: String,
    status: u16,
}

/// What was refused, by reason.
type Refusals<R> = Family<[(&'static str, R); 1], Counter>;

fn refused<R: Clone + Hash + Eq>(refusals: &Refusals<R>, reason: R) {
    refusals.get_or_create(&[("reason", reason)]).inc();
}

/// The counters.
#[derive(Debug)]
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Request, Counter>,
    uploads_refused: Refusals<UploadRefusal>,
    tokens_refused: Refusals<TokenRefusal>,
    offers_refused: Refusals<OfferRefusal>,
    relay: Relay,
    /// Senders connected to this instance.
    pub(crate) rooms: Gauge,
    /// Connections open.
    pub(crate) connections: Gauge,
    /// Viewers that this instance forwards to; looked up when it is asked for.
    pub(crate) forwarded_to: Gauge,
    /// Connections closed at once because there were too many.
    pub(crate) connections_refused: Counter,
    /// Connections without a valid token that were closed in favour of new ones.
    pub(crate) connections_replaced: Counter,
    /// Connections and requests of blocked addresses.
    pub(crate) blocked: Counter,
    /// Senders refused because there were too many, or their seat was taken.
    pub(crate) senders_refused: Counter,
    /// Viewers given an answer by this instance.
    pub(crate) viewers_joined: Counter,
    /// Requests refused for coming too fast.
    pub(crate) rate_limited: Counter,
    /// Bytes of packages received.
    pub(crate) bytes_up: Counter,
    /// Bytes of packages sent.
    pub(crate) bytes_down: Counter,
    /// Packages stored.
    pub(crate) packages_stored: Counter,
    /// Packages read to see whether they are intact.
    pub(crate) packages_checked: Counter,
}

impl Metrics {
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("mon3tr");
        let requests = Family::default();
        let uploads_refused = Family::default();
        let (tokens_refused, offers_refused) = (Family::default(), Family::default());
        let (rooms, connections) = (Gauge::default(), Gauge::default());
        let forwarded_to = Gauge::default();
        let counter = |registry: &mut Registry, name: &str, help: &str| {
            let counter = Counter::default();
            registry.register(name, help, counter.clone());
            counter
        };
        registry.register(
            "requests",
            "Requests answered, by route and status",
            requests.clone(),
        );
        registry.register(
            "uploads_refused",
            "Uploads refused, by reason",
            uploads_refused.clone(),
        );
        registry.register(
            "tokens_refused",
            "Requests without a token that holds, by reason",
            tokens_refused.clone(),
        );
        registry.register(
            "offers_refused",
            "Viewers' offers refused by the server, by reason",
            offers_refused.clone(),
        );
        let relay = Relay::registered(&mut registry);
        registry.register(
            "rooms",
            "Rooms whose sender is connected here",
            rooms.clone(),
        );
        registry.register("connections", "Connections open", connections.clone());
        registry.register(
            "viewers_forwarded_to",
            "Viewers that this server forwards to now",
            forwarded_to.clone(),
        );
        let (r, new) = (&mut registry, counter);
        let connections_refused = new(
            r,
            "connections_refused",
            "Connections closed because there were too many",
        );
        let connections_replaced = new(
            r,
            "connections_replaced",
            "Connections without a valid token closed in favour of new ones",
        );
        let blocked = new(
            r,
            "blocked",
            "Connections and requests of blocked addresses",
        );
        let senders_refused = new(
            r,
            "senders_refused",
            "Senders refused because there were too many, or their seat was taken",
        );
        let viewers_joined = new(r, "viewers_joined", "Viewers given a sender's answer");
        let rate_limited = new(r, "rate_limited", "Requests refused for coming too fast");
        let bytes_up = new(r, "package_bytes_received", "Bytes of packages received");
        let bytes_down = new(r, "package_bytes_sent", "Bytes of packages sent");
        let packages_stored = new(r, "packages_stored", "Packages put into the store");
        let packages_checked = new(
            r,
            "packages_checked",
            "Packages read to see whether they are intact",
        );
        Self {
            registry,
            requests,
            uploads_refused,
            tokens_refused,
            offers_refused,
            relay,
            rooms,
            connections,
            forwarded_to,
            connections_refused,
            connections_replaced,
            blocked,
            senders_refused,
            viewers_joined,
            rate_limited,
            bytes_up,
            bytes_down,
            packages_stored,
            packages_checked,
        }
    }

    /// Counts a request; `route` is a pattern of the router's.
    pub(crate) fn request(&self, route: &str, status: u16) {
        let labels = Request {
            route: route.to_owned(),
            status,
        };
        self.requests.get_or_create(&labels).inc();
    }

    pub(crate) fn upload_refused(&self, reason: UploadRefusal) {
        refused(&self.uploads_refused, reason);
    }

    pub(crate) fn token_refused(&self, reason: TokenRefusal) {
        refused(&self.tokens_refused, reason);
    }

    pub(crate) fn offer_refused(&self, reason: OfferRefusal) {
        refused(&self.offers_refused, reason);
    }

    /// Takes over what the relay has counted.
    pub(crate) fn relay(&self, counts: turn_server::Counts) {
        self.relay.set(counts);
    }

    /// All of it as OpenMetrics text.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        if text::encode(&mut text, &self.registry).is_err() {
            // Writing to a String cannot fail.
            text.clear();
        }
        text
    }
}
