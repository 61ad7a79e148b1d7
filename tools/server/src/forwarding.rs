//! What the server asks of the program's part that forwards, which it has none of itself: motion and voice are a call's. A sender that serves as many viewers as
//! it will refuses the next one's offer; where the server forwards, the offer goes there.

use link_protocol::{Announcement, IceServers, Name};
use std::fmt;

/// Takes viewers whom their sender hands over.
#[async_trait::async_trait]
pub trait Forwarding: fmt::Debug + Send + Sync {
    /// The answer to a viewer's offer; nothing where this one is not taken.
    async fn take(&self, viewer: HandedOver) -> Option<String>;

    /// A viewer says that it has left, if it is one that was taken here.
    fn leave(&self, session: &Name);

    /// Viewers that are forwarded to now.
    fn viewers(&self) -> usize;
}

/// A viewer whom a sender hands over.
#[derive(Debug)]
pub struct HandedOver {
    /// Where its sender is.
    pub room: Box<dyn SendersRoom>,
    /// Its session's name.
    pub session: Name,
    /// Its SDP.
    pub offer: String,
    /// What the room calls its network, by which places are shared.
    pub network: Name,
}

/// The room of a sender on this instance or another one, as the server's own forwarder sees it.
#[async_trait::async_trait]
pub trait SendersRoom: fmt::Debug + Send + Sync {
    /// The room's name.
    fn name(&self) -> Name;

    /// What its sender announces; nothing while it is absent, or the server ends.
    async fn announcement(&self) -> Option<Announcement>;

    /// The STUN and TURN servers for a connection there, with credentials from now on.
    fn ice_servers(&self) -> IceServers;

    /// Offers the sender a connection, in the forwarder's name; the session's name and the answer.
    async fn offer(&self, sdp: &str) -> Option<(Name, String)>;

    /// Tells the sender that a viewer whom it handed over is forwarded to no longer, or could not be.
    async fn left(&self, session: &Name);
}
