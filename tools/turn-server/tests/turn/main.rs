//! The server against a client of another's code: what works, what is refused, and what is bounded.

mod attacks;
mod client;
mod relaying;

use std::net::{IpAddr, SocketAddr};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use turn_server::credentials::Credentials;
use turn_server::{Config, Key, Limits, TurnServer};

/// A server on a free port of the loopback.
fn server(change: impl FnOnce(&mut Config)) -> (TurnServer, SocketAddr) {
    let mut config = Config::new(([127, 0, 0, 1], 0).into(), key());
    change(&mut config);
    let server = TurnServer::start(config).expect("a server");
    let address = server.address();
    (server, address)
}

fn key() -> Key {
    Key::new([3; 32])
}

fn credentials() -> Credentials {
    key().issue("room", unix_now() + 60)
}

fn unix_now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_secs())
}

fn set_limits(change: impl FnOnce(&mut Limits)) -> impl FnOnce(&mut Config) {
    |config| change(&mut config.limits)
}

/// An address of the world, by which a server on the loopback is said to be reached.
fn external(config: &mut Config) {
    config.external = Some(IpAddr::from([203, 0, 113, 7]));
}

async fn pause() {
    tokio::time::sleep(Duration::from_millis(100)).await;
}
