//! One WebRTC connection with one data channel. All that knows the `webrtc` crate is here.

use crate::{ChannelMode, LinkError};
use bytes::{Bytes, BytesMut};
use rtc::ice::mdns::MulticastDnsMode;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use webrtc::data_channel::{DataChannel, DataChannelEvent, RTCDataChannelInit};
use webrtc::error::Error;
use webrtc::peer_connection::{
    PeerConnection, PeerConnectionBuilder, PeerConnectionEventHandler, RTCConfigurationBuilder,
    RTCIceGatheringState, RTCPeerConnectionState, RTCSessionDescription, SettingEngineBuilder,
};

/// The channel's label; the protocol beside it carries version and session.
const LABEL: &str = "mon3tr";
const PROTOCOL: &str = "mon3tr.1.";

/// Bytes that may wait to be sent: some eight motion frames. The default, no limit, lets a slow network put seconds of old
/// motion before the newest.
const SEND_BUFFER: usize = 4_000;

/// Largest message of the protocol, with room to spare; larger ones are dropped unread.
const LARGEST_MESSAGE: usize = 4_096;

/// Messages that may wait to be read. A reader that is that far behind wants the newest, not all.
const WAITING: usize = 256;

/// ICE: silence until a connection counts as disconnected, until it has failed, and between keep-alives. The defaults take 28 s
/// to see a dead peer.
const ICE_TIMEOUTS: [Duration; 3] = [
    Duration::from_secs(1),
    Duration::from_secs(3),
    Duration::from_millis(500),
];

/// Candidates are this machine's own addresses, so gathering takes milliseconds.
const GATHERING: Duration = Duration::from_secs(2);

/// What happens on a connection.
#[derive(Debug)]
pub(super) enum PeerEvent {
    /// The channel is open, for messages of this session.
    Open { session: u32 },
    /// A message came.
    Message(Bytes),
    /// The other side closed the channel, or the connection failed.
    Closed,
}

/// What became of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sent {
    /// It is on its way.
    Queued,
    /// Too much is waiting already: skipped.
    Skipped,
    /// There is no channel (any more).
    Closed,
}

/// One end of a connection. Dropping it closes it in the background.
pub(super) struct Peer {
    connection: Arc<dyn PeerConnection>,
    channel: Option<Arc<dyn DataChannel>>,
    happenings: mpsc::Receiver<Happening>,
}

impl std::fmt::Debug for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Peer").finish_non_exhaustive()
    }
}

enum Happening {
    Channel(Arc<dyn DataChannel>),
    Event(PeerEvent),
}

/// Passes on what the connection's driver calls back with. Never waits: it is the driver's own task.
struct Handler {
    happenings: mpsc::Sender<Happening>,
    gathered: mpsc::Sender<()>,
}

#[async_trait::async_trait]
impl PeerConnectionEventHandler for Handler {
    async fn on_ice_gathering_state_change(&self, state: RTCIceGatheringState) {
        if state == RTCIceGatheringState::Complete {
            let _ = self.gathered.try_send(());
        }
    }

    async fn on_connection_state_change(&self, state: RTCPeerConnectionState) {
        log::debug!("connection: {state}");
        if matches!(
            state,
            RTCPeerConnectionState::Failed | RTCPeerConnectionState::Closed
        ) {
            let _ = self
                .happenings
                .try_send(Happening::Event(PeerEvent::Closed));
        }
    }

    async fn on_data_channel(&self, channel: Arc<dyn DataChannel>) {
        // A second channel is nothing of ours; the queue has room for the first.
        let _ = self.happenings.try_send(Happening::Channel(channel));
    }
}

impl Peer {
    /// Begins a call: opens the channel and returns the offer with all candidates. `local` are the addresses to bind.
    pub(super) async fn offer(
        local: Vec<SocketAddr>,
        mode: ChannelMode,
        session: u32,
    ) -> Result<(Self, String), LinkError> {
        let (mut peer, gathered) = Self::new(local).await?;
        let unreliable = mode == ChannelMode::Unreliable;
        let channel = peer
            .connection
            .create_data_channel(
                LABEL,
                Some(RTCDataChannelInit {
                    ordered: !unreliable,
                    max_retransmits: unreliable.then_some(0),
                    protocol: format!("{PROTOCOL}{session:08x}"),
                    ..RTCDataChannelInit::default()
                }),
            )
            .await?;
        peer.listen(channel, session);
        let offer = peer.connection.create_offer(None).await?;
        let sdp = peer.describe(offer, gathered).await?;
        Ok((peer, sdp))
    }

    /// Answers an offer; the channel comes with [`PeerEvent::Open`].
    pub(super) async fn answer(
        local: Vec<SocketAddr>,
        offer: String,
    ) -> Result<(Self, String), LinkError> {
        let (peer, gathered) = Self::new(local).await?;
        let offer = RTCSessionDescription::offer(offer)?;
        peer.connection.set_remote_description(offer).await?;
        let answer = peer.connection.create_answer(None).await?;
        let sdp = peer.describe(answer, gathered).await?;
        Ok((peer, sdp))
    }

    /// Takes the other side's answer to this side's offer.
    pub(super) async fn accept(&self, answer: String) -> Result<(), LinkError> {
        let answer = RTCSessionDescription::answer(answer)?;
        Ok(self.connection.set_remote_description(answer).await?)
    }

    async fn new(local: Vec<SocketAddr>) -> Result<(Self, mpsc::Receiver<()>), LinkError> {
        let [disconnected, failed, keep_alive] = ICE_TIMEOUTS.map(Some);
        let settings = SettingEngineBuilder::new()
            // It needs port 5353, and a local name tells a viewer elsewhere nothing.
            .with_multicast_dns_mode(MulticastDnsMode::Disabled)
            .with_ice_timeouts(disconnected, failed, keep_alive)
            .with_host_acceptance_min_wait(None)
            .build();
        let (happenings, waiting) = mpsc::channel(WAITING);
        let (gathered_now, gathered) = mpsc::channel(1);
        let connection = PeerConnectionBuilder::new()
            .with_configuration(RTCConfigurationBuilder::new().build())
            .with_setting_engine(settings)
            .with_handler(Arc::new(Handler {
                happenings,
                gathered: gathered_now,
            }))
            .with_udp_addrs(local)
            .with_data_channel_send_buffer_limit(SEND_BUFFER)
            .build()
            .await?;
        let peer = Self {
            connection: Arc::new(connection),
            channel: None,
            happenings: waiting,
        };
        Ok((peer, gathered))
    }

    /// Takes `description` for this side's own and returns it with all candidates.
    async fn describe(
        &self,
        description: RTCSessionDescription,
        mut gathered: mpsc::Receiver<()>,
    ) -> Result<String, LinkError> {
        self.connection.set_local_description(description).await?;
        // What has been gathered by then is offered.
        let _ = tokio::time::timeout(GATHERING, gathered.recv()).await;
        let description = self.connection.local_description().await;
        Ok(description.ok_or(LinkError::NoDescription)?.sdp)
    }

    /// Reads the channel from a task of its own; its events come through [`Self::next`].
    fn listen(&mut self, channel: Arc<dyn DataChannel>, session: u32) {
        let (events, waiting) = mpsc::channel(WAITING);
        self.channel = Some(Arc::clone(&channel));
        // What the handler says from now on comes through the same queue.
        let mut handlers = std::mem::replace(&mut self.happenings, waiting);
        tokio::spawn(async move {
            let mut open = false;
            loop {
                let event = tokio::select! {
                    event = channel.poll() => event,
                    happening = handlers.recv() => match happening {
                        Some(Happening::Channel(_)) => continue,
                        Some(Happening::Event(PeerEvent::Closed)) | None => None,
                        Some(Happening::Event(_)) => continue,
                    },
                };
                let told = match event {
                    Some(DataChannelEvent::OnOpen) if !open => {
                        open = true;
                        events.try_send(Happening::Event(PeerEvent::Open { session }))
                    }
                    Some(DataChannelEvent::OnMessage(message)) => {
                        if message.data.len() > LARGEST_MESSAGE {
                            log::debug!("a message of {} bytes is dropped", message.data.len());
                            continue;
                        }
                        if !open {
                            open = true;
                            let _ = events.try_send(Happening::Event(PeerEvent::Open { session }));
                        }
                        events.try_send(Happening::Event(PeerEvent::Message(message.data.freeze())))
                    }
                    Some(DataChannelEvent::OnClose | DataChannelEvent::OnClosing) | None => {
                        let _ = events.send(Happening::Event(PeerEvent::Closed)).await;
                        return;
                    }
                    Some(_) => Ok(()),
                };
                if let Err(mpsc::error::TrySendError::Closed(_)) = told {
                    return;
                }
            }
        });
    }

    /// The next event. After [`PeerEvent::Closed`] there is nothing more.
    pub(super) async fn next(&mut self) -> PeerEvent {
        loop {
            match self.happenings.recv().await {
                Some(Happening::Event(event)) => return event,
                None => return PeerEvent::Closed,
                Some(Happening::Channel(channel)) => {
                    let protocol = channel.protocol().await.unwrap_or_default();
                    match session_of(&protocol) {
                        Some(session) => self.listen(channel, session),
                        None => log::debug!("a channel of protocol {protocol:?} is left alone"),
                    }
                }
            }
        }
    }

    /// Sends `message` unless too much is waiting.
    pub(super) async fn try_send(&self, message: &[u8]) -> Sent {
        let Some(channel) = &self.channel else {
            return Sent::Closed;
        };
        match channel.try_send(BytesMut::from(message)).await {
            Ok(()) => Sent::Queued,
            Err(Error::ErrSendBufferFull) => Sent::Skipped,
            Err(_) => Sent::Closed,
        }
    }

    /// Closes the connection, telling the other side.
    pub(super) async fn close(&self) {
        if let Some(channel) = &self.channel {
            let _ = channel.close().await;
        }
        if let Err(error) = self.connection.close().await {
            log::debug!("closing a connection: {error}");
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let connection = Arc::clone(&self.connection);
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(async move { connection.close().await });
        }
    }
}

/// The session that a channel's protocol names.
fn session_of(protocol: &str) -> Option<u32> {
    let digits = protocol.strip_prefix(PROTOCOL)?;
    let plain = digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    plain.then(|| u32::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loopback() -> Vec<SocketAddr> {
        vec![([127, 0, 0, 1], 0).into()]
    }

    #[tokio::test]
    async fn two_peers_meet_and_part() {
        for mode in [ChannelMode::Unreliable, ChannelMode::Reliable] {
            let (mut viewer, offer) = Peer::offer(loopback(), mode, 0xfeed)
                .await
                .expect("an offer");
            let (mut sender, answer) = Peer::answer(loopback(), offer).await.expect("an answer");
            viewer.accept(answer).await.expect("a good answer");
            for peer in [&mut viewer, &mut sender] {
                let first = peer.next().await;
                assert!(
                    matches!(first, PeerEvent::Open { session: 0xfeed }),
                    "{first:?} on a {mode} channel"
                );
            }
            assert_eq!(sender.try_send(b"motion").await, Sent::Queued, "{mode}");
            let message = viewer.next().await;
            assert!(
                matches!(&message, PeerEvent::Message(bytes) if bytes[..] == *b"motion"),
                "{message:?} on a {mode} channel"
            );
            viewer.close().await;
            let last = tokio::time::timeout(Duration::from_secs(4), sender.next()).await;
            assert!(matches!(last, Ok(PeerEvent::Closed)), "{last:?}");
        }
    }

    #[test]
    fn only_our_protocol_names_a_session() {
        assert_eq!(session_of("mon3tr.1.0000feed"), Some(0xfeed));
        for other in [
            "",
            "mon3tr.1.",
            "mon3tr.1.feed",
            "mon3tr.2.0000feed",
            "mon3tr.1.+000feed",
        ] {
            assert_eq!(session_of(other), None, "{other}");
        }
    }
}
