//! Counters of a server that was built without metrics: they count nothing.

use super::{OfferRefusal, TokenRefusal, UploadRefusal};

/// A counter or gauge.
#[derive(Debug, Default)]
pub(crate) struct Uncounted;

impl Uncounted {
    pub(crate) fn inc(&self) {}

    pub(crate) fn inc_by(&self, _: u64) {}

    pub(crate) fn set(&self, _: i64) {}
}

/// The same counters as with metrics.
#[derive(Debug, Default)]
pub(crate) struct Metrics {
    pub(crate) rooms: Uncounted,
    pub(crate) connections: Uncounted,
    pub(crate) connections_refused: Uncounted,
    pub(crate) connections_replaced: Uncounted,
    pub(crate) blocked: Uncounted,
    pub(crate) senders_refused: Uncounted,
    pub(crate) viewers_joined: Uncounted,
    pub(crate) rate_limited: Uncounted,
    pub(crate) bytes_up: Uncounted,
    pub(crate) bytes_down: Uncounted,
    pub(crate) packages_stored: Uncounted,
    pub(crate) packages_checked: Uncounted,
}

impl Metrics {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    pub(crate) fn request(&self, _: &str, _: u16) {}

    pub(crate) fn upload_refused(&self, _: UploadRefusal) {}

    pub(crate) fn token_refused(&self, _: TokenRefusal) {}

    pub(crate) fn offer_refused(&self, _: OfferRefusal) {}
}
