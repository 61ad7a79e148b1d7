//! What is counted, for `/metrics`. Every label has a fixed, small set of values: nothing a client sends becomes one.

#[cfg(feature = "metrics")]
mod counted;
#[cfg(feature = "metrics")]
mod relay;
#[cfg(not(feature = "metrics"))]
mod uncounted;

#[cfg(feature = "metrics")]
pub(crate) use counted::Metrics;
#[cfg(not(feature = "metrics"))]
pub(crate) use uncounted::Metrics;

/// Why a token was refused.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
#[cfg_attr(
    feature = "metrics",
    derive(prometheus_client::encoding::EncodeLabelValue)
)]
pub(crate) enum TokenRefusal {
    /// The request has none, or several.
    Missing,
    /// It is not genuine, or has expired.
    Invalid,
    /// It, or one that it was made with, is revoked.
    Revoked,
}

/// Why a viewer's offer was refused by the server.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
#[cfg_attr(
    feature = "metrics",
    derive(prometheus_client::encoding::EncodeLabelValue)
)]
pub(crate) enum OfferRefusal {
    /// Too many viewers of the room wait for an answer.
    Busy,
    /// The sender did not answer in time.
    Unanswered,
}

/// Why an upload was refused.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
#[cfg_attr(
    feature = "metrics",
    derive(prometheus_client::encoding::EncodeLabelValue)
)]
pub(crate) enum UploadRefusal {
    /// More bytes than a package may have.
    TooLarge,
    /// It stopped before its end, or paused for too long.
    Incomplete,
    /// Its bytes have another hash.
    Hash,
    /// It is no intact package.
    Package,
    /// The disk is full.
    DiskFull,
    /// Too many uploads at once.
    Busy,
    /// Its owner has as much as it may have.
    Quota,
    /// The members of its call have put as many as they may.
    Call,
    /// Too many were begun from its address, in its call.
    Tries,
    /// The spool or the store failed.
    Storage,
}
