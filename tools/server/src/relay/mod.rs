//! How instances share their rooms.

#[cfg(not(feature = "nats"))]
mod alone;
#[cfg(feature = "nats")]
mod nats;

#[cfg(not(feature = "nats"))]
pub(crate) use alone::Relay;
#[cfg(feature = "nats")]
pub(crate) use nats::Relay;
