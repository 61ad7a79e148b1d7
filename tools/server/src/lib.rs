//! Signaling and the avatar store: the paper's *Signaling* stage, and where *Amortization* fetches the avatar.
//!
//! The server introduces a sender to its viewers and keeps packages; motion passes through it only where a program forwards ([`Forwarding`]), sealed. The wire is
//! `docs/protocol.md`. It deliberately keeps no accounts and no rooms: tokens say what their bearer may do, and a room
//! is where its sender is connected.

#![forbid(unsafe_code)]

mod admission;
mod blocked;
mod config;
mod connections;
mod error;
mod forwarding;
mod http;
mod ice;
mod id;
mod limit_values;
mod metrics;
mod packages;
mod relay;
mod reread;
mod revoked;
mod rooms;
mod secret;
mod server;
#[cfg(feature = "tls")]
mod tls;
mod token;
mod turn;
mod turn_at;

pub use config::{Config, Limits, StoreConfig, TurnConfig};
pub use error::ServerError;
pub use forwarding::{Forwarding, HandedOver, SendersRoom};
pub use ice::own_address;
pub use id::Id;
pub use revoked::revoke;
pub use secret::Secret;
pub use server::Server;
pub use token::now;
#[cfg(feature = "tls")]
pub use turn::Relay;
pub use turn_at::TurnAt;
