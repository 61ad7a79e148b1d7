//! A TURN server (RFC 8656, with UDP relays) that answers STUN as well (RFC 8489): a call whose two sides find no direct way exchanges its
//! packets, which stay encrypted from end to end, through addresses that this server lends them.
//!
//! It is made to be run by anyone who runs a Mon3tr server: clients reach it on one port over UDP, TCP, and TLS on the port of TCP; credentials
//! are limited in time and stored nowhere ([`credentials`]); packets go to the internet and to the server's own other clients, but neither to
//! the server itself nor to the networks it stands in; every client is bounded in allocations, peers and rate ([`Limits`]). Two
//! clients of one server reach one another without a port besides that one: their packets never leave the process.
//!
//! ```no_run
//! use turn_server::{Config, Key, TurnServer};
//!
//! # async fn run() -> Result<(), Box<dyn std::error::Error>> {
//! let key = Key::new([0; 32]);
//! let server = TurnServer::start(Config::new("0.0.0.0:3478".parse()?, key.clone()))?;
//! let credentials = key.issue("room", 1_900_000_000);
//! println!("{} as {}", server.address(), credentials.username);
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

mod allocation;
mod budget;
mod config;
mod connections;
pub mod credentials;
mod holder;
mod message;
mod peers;
mod server;
mod service;
mod strangers;
mod table;

pub use config::{Admission, Config, Limits};
pub use credentials::Key;
pub use server::{TurnError, TurnServer};
pub use service::Counts;
pub use table::network_prefix;
