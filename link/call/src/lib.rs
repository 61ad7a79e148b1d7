//! A call over WebRTC (`docs/protocol.md`): a [`Sender`] is present in a room and sends motion and voice to every viewer, a
//! [`Viewer`] joins a room and hands over what arrives. Both keep the call up through outages and restarts, in tasks of a tokio runtime.
//! The crate draws nothing, and plays nothing out: frames leave a `Viewer` as they arrive, and `link_playout` and `link_voice` decide when each is shown and heard.
//!
//! A program that joins a room and prints the frames:
//!
//! ```no_run
//! use link_call::{Authentication, CallEvent, Viewer};
//! use link_http::Client;
//! use link_playout::Clock;
//! use link_protocol::RoomLink;
//! use link_voice::VoiceQueue;
//! use std::time::Duration;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let room: RoomLink = std::env::args().nth(1).ok_or("usage: PROGRAM LINK")?.parse()?;
//! let runtime = tokio::runtime::Runtime::new()?;
//! let _entered = runtime.enter();
//! let client = Client::new(None)?;
//! let viewer =
//!     Viewer::join(client, room, Authentication::default(), Clock::start(), VoiceQueue::default());
//! // After the last event there is none: the loop ends with the call.
//! while let Ok(event) = viewer.next(Duration::MAX) {
//!     match event {
//!         CallEvent::Announced(announcement) => println!("avatar {}", announcement.avatar.sha256),
//!         CallEvent::Joined => println!("connected"),
//!         CallEvent::Frame { frame, .. } => {
//!             println!("frame {} at {}", frame.sequence, frame.motion.root_translation);
//!         }
//!         CallEvent::State(state) => println!("muted: {}, hidden: {}", state.muted, state.hidden),
//!         CallEvent::HungUp => println!("the sender has hung up"),
//!         CallEvent::Failed(error) => return Err(error.into()),
//!     }
//! }
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

mod addresses;
mod admission;
mod candidates;
pub mod door;
mod epochs;
mod error;
pub mod forward;
mod guests;
mod introduction;
mod losses;
pub mod membership;
mod nudge;
pub mod path;
mod peer;
mod plan;
mod privacy;
mod proof;
pub mod reach;
mod scope;
mod screening;
mod sdp;
mod seal;
mod seats;
pub mod sender;
mod session;
mod signaling;
mod telling;
mod tunnel;
pub mod viewer;
mod visitor;
mod voice_track;

pub use door::Door;
pub use error::CallError;
pub use introduction::{Authentication, Credentials};
pub use path::Path;
pub use plan::{Relay, RelayTransport};
pub use privacy::Privacy;
pub use sdp::SdpError;
pub use seats::Venue;
pub use sender::Sender;
pub use signaling::Signaling;
pub use viewer::{CallEvent, Viewer};
pub use visitor::{Visitor, Who};

use link_http::Client;
use link_protocol::data_channel::Message;
use peer::{Peer, PeerEvent, SendOutcome};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::sync::watch;

/// How often a bye is sent until it is answered, and how far apart: in all as long as SCTP takes to retransmit a lost message.
const BYES: u32 = 30;
const BETWEEN_BYES: Duration = Duration::from_millis(50);

/// Sends byes until the other side answers or the channel is closed; returns whether it answered.
async fn send_bye(peer: &mut Peer, session: u32) -> bool {
    let mut bye = Vec::new();
    Message::Bye.write(session, &mut bye);
    for _ in 0..BYES {
        if peer.try_send(&bye).await == SendOutcome::Closed {
            return false;
        }
        let answered = async {
            loop {
                match peer.next().await {
                    PeerEvent::Closed => return,
                    PeerEvent::Message(bytes)
                        if Message::read(&bytes, session) == Some(Message::Bye) =>
                    {
                        return;
                    }
                    PeerEvent::Message(_) | PeerEvent::Voice(_) | PeerEvent::Open => {}
                }
            }
        };
        if tokio::time::timeout(BETWEEN_BYES, answered).await.is_ok() {
            return true;
        }
    }
    false
}

/// Answers a bye, and waits until the answer is sent, for the connection is closed after it.
async fn answer_bye(peer: &Peer, session: u32) {
    let mut bye = Vec::new();
    Message::Bye.write(session, &mut bye);
    peer.try_send(&bye).await;
    tokio::time::sleep(BETWEEN_BYES).await;
}

/// Drops the client's connections to the server: those that began at an address which this machine no longer has lead nowhere.
fn renew(client: &mut Client) {
    match client.with_new_connections() {
        Ok(renewed) => *client = renewed,
        Err(error) => log::debug!("the client keeps its connections: {error}"),
    }
}

/// Waits until the flag is set or its owner is dropped.
async fn is_set(flag: &mut watch::Receiver<bool>) {
    // Not inline in `select!`: what `wait_for` returns holds a lock, which a task must not keep while it waits for something else.
    let _ = flag.wait_for(|set| *set).await;
}

/// Pauses between attempts, doubled each time.
#[derive(Debug)]
struct Backoff(Duration);

impl Backoff {
    const FIRST: Duration = Duration::from_millis(100);
    const LONGEST: Duration = Duration::from_secs(1);

    fn next(&mut self) -> Duration {
        // At random, so that programs that lost the same server do not come back at the same moment.
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

/// A random number from 0 to 1.
fn random_share() -> f64 {
    f64::from(getrandom::u32().unwrap_or(u32::MAX / 2)) / f64::from(u32::MAX)
}

/// Seconds since 1970. A clock before that lets no permit expire, which the owner's signature outlives.
pub(crate) fn now() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_secs())
}
