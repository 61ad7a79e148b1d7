//! The HTTP client against a small server that misbehaves on demand. The real server is tested with its own crate.

mod cache;
mod download;
mod presence;
mod processes;
mod rooms;
mod secrecy;
mod server;
mod tls;
mod upload;

use std::time::Duration;

use link_http::{Client, client::Patience};

/// A client that loses its patience within a test's time.
fn client() -> Client {
    let patience = Patience {
        connect: Duration::from_secs(2),
        answer: Duration::from_secs(2),
        silence: Duration::from_millis(500),
        store: Duration::from_secs(5),
        pause: Duration::from_millis(5),
    };
    Client::with_patience(None, patience).expect("a client")
}
