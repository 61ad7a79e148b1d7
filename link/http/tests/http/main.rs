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

use link_http::{Client, client::Timeouts};

/// A client whose timeouts end within a test's time.
fn client() -> Client {
    let timeouts = Timeouts {
        connect: Duration::from_secs(2),
        response: Duration::from_secs(2),
        idle: Duration::from_millis(500),
        pace: Duration::from_secs(1),
        store: Duration::from_secs(5),
        retry: Duration::from_millis(5),
    };
    Client::with_timeouts(None, timeouts).expect("a client")
}
