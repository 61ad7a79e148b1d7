//! The call itself: one WebRTC connection with one data channel between a sender and each viewer, kept up by both sides.

mod error;
pub mod host;
mod peer;
mod session;
pub mod viewer;

pub use error::CallError;
pub use host::Host;
pub use viewer::{CallEvent, Viewer};

use link_protocol::message::Message;
use link_protocol::room_link::ServerUrl;
use peer::{Peer, PeerEvent, Sent};
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;
use tokio::sync::watch;

/// How often a goodbye is said until it is answered, and how far apart: in all as long as SCTP takes to send a lost message again.
const GOODBYES: u32 = 30;
const BETWEEN_GOODBYES: Duration = Duration::from_millis(50);

/// Says goodbye until the other side has heard it, or cannot; returns whether it has.
async fn part(peer: &mut Peer, session: u32) -> bool {
    let mut bye = Vec::new();
    Message::Bye.write(session, &mut bye);
    for _ in 0..GOODBYES {
        if peer.try_send(&bye).await == Sent::Closed {
            return false;
        }
        let heard = async {
            loop {
                match peer.next().await {
                    PeerEvent::Closed => return,
                    PeerEvent::Message(bytes)
                        if Message::read(&bytes, session) == Some(Message::Bye) =>
                    {
                        return;
                    }
                    PeerEvent::Message(_) | PeerEvent::Open => {}
                }
            }
        };
        if tokio::time::timeout(BETWEEN_GOODBYES, heard).await.is_ok() {
            return true;
        }
    }
    false
}

/// Answers a goodbye, and lets the answer leave before the connection is closed.
async fn part_too(peer: &Peer, session: u32) {
    let mut bye = Vec::new();
    Message::Bye.write(session, &mut bye);
    peer.try_send(&bye).await;
    tokio::time::sleep(BETWEEN_GOODBYES).await;
}

/// The addresses a connection binds: every network of this machine, and loopback where the server is reached by it, for both ends may be here.
fn local_addresses(server: &ServerUrl) -> Vec<SocketAddr> {
    let mut addresses = vec![SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0))];
    if server.is_loopback() {
        addresses.push((Ipv4Addr::LOCALHOST, 0).into());
    }
    addresses
}

/// Waits until the flag is up, or nobody is left to raise it.
async fn raised(flag: &mut watch::Receiver<bool>) {
    // Not in place: what `wait_for` returns holds a lock, which a task must not keep while it waits for something else.
    let _ = flag.wait_for(|up| *up).await;
}

/// Longer and longer pauses between attempts.
#[derive(Debug)]
struct Backoff(Duration);

impl Backoff {
    const FIRST: Duration = Duration::from_millis(100);
    const LONGEST: Duration = Duration::from_secs(1);

    fn next(&mut self) -> Duration {
        // Many who lost the same server must not come back in step.
        let pause = self.0.mul_f64(0.75 + 0.5 * random_share());
        self.0 = (self.0 * 2).min(Self::LONGEST);
        pause
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

impl Default for Backoff {
    fn default() -> Self {
        Self(Self::FIRST)
    }
}

/// A number that another machine would not draw alike.
fn random_share() -> f64 {
    f64::from(getrandom::u32().unwrap_or(u32::MAX / 2)) / f64::from(u32::MAX)
}
