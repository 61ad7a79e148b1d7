//! What is counted, for `/metrics`. Every label has a fixed, small set of values: nothing a client sends becomes one.

#[cfg(feature = "metrics")]
mod counted;
#[cfg(not(feature = "metrics"))]
mod uncounted;

#[cfg(feature = "metrics")]
pub(crate) use counted::Metrics;
#[cfg(not(feature = "metrics"))]
pub(crate) use uncounted::Metrics;

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
    /// The spool or the store failed.
    Storage,
}
