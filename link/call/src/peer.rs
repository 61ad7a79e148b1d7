//! One WebRTC connection with one data channel. All that knows the `webrtc` crate is here.

use crate::{CallError, raised};
use bytes::{Bytes, BytesMut};
use link_protocol::announcement::ChannelMode;
use rtc::ice::mdns::MulticastDnsMode;
use rtc::peer_connection::transport::RTCDtlsRole;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use webrtc::data_channel::{DataChannel, DataChannelEvent, RTCDataChannelInit};
use webrtc::error::Error;
use webrtc::peer_connection::{
    CipherSuiteId, PeerConnection, PeerConnectionBuilder, PeerConnectionEventHandler,
    RTCConfigurationBuilder, RTCIceGatheringState, RTCPeerConnectionState, RTCSessionDescription,
    SettingEngineBuilder,
};

/// There is a channel for each direction, both agreed on beforehand. The library would send reliably, whatever was asked for, on a channel that
/// the other side opened in-band, and on one that the other side used first.
const PROTOCOL: &str = "mon3tr.1";
const MOTION: (u16, &str) = (0, "motion");
const FEEDBACK: (u16, &str) = (1, "feedback");

/// Bytes that may wait to be sent: some eight motion frames. The default, no limit, lets a slow network put seconds of old
/// motion before the newest.
const SEND_BUFFER: usize = 4_000;

/// Largest message of the protocol, with room to spare; larger ones are dropped unread.
const LARGEST_MESSAGE: usize = 4_096;

/// Messages that may wait to be read. A reader that is that far behind wants the newest, not all.
const WAITING: usize = 256;

/// ICE: silence until a connection counts as disconnected, until it has failed, and between keep-alives. Motion and feedback tell sooner
/// that a peer is gone, so these may be slow: at half a second the keep-alives alone take 5 kbit/s each way.
const ICE_TIMEOUTS: [Duration; 3] = [
    Duration::from_secs(5),
    Duration::from_secs(10),
    Duration::from_secs(2),
];

/// The first wherever the other side has it too, as browsers do: its records are 8 bytes shorter, for it sends no nonce.
const CIPHERS: [CipherSuiteId; 2] = [
    CipherSuiteId::Tls_Ecdhe_Ecdsa_With_ChaCha20_Poly1305_Sha256,
    CipherSuiteId::Tls_Ecdhe_Ecdsa_With_Aes_128_Gcm_Sha256,
];

/// Candidates are this machine's own addresses, so gathering takes milliseconds.
const GATHERING: Duration = Duration::from_secs(2);

/// What happens on a connection.
#[derive(Debug)]
pub(crate) enum PeerEvent {
    /// The channel is open.
    Open,
    /// A message came.
    Message(Bytes),
    /// The other side closed the channel, or the connection failed.
    Closed,
}

/// What became of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sent {
    /// It is on its way.
    Queued,
    /// Too much is waiting already: skipped.
    Skipped,
    /// There is no channel (any more).
    Closed,
}

/// One end of a connection. Dropping it closes it in the background.
pub(crate) struct Peer {
    connection: Arc<dyn PeerConnection>,
    /// What this side sends on.
    own: Arc<dyn DataChannel>,
    events: mpsc::Receiver<PeerEvent>,
    gathered: mpsc::Receiver<()>,
}

impl std::fmt::Debug for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Peer").finish_non_exhaustive()
    }
}

/// Passes on what the connection's driver calls back with. Never waits: it is the driver's own task.
struct Handler {
    failed: watch::Sender<bool>,
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
            self.failed.send_replace(true);
        }
    }
}

impl Peer {
    /// Begins a call as a viewer: returns the offer with all candidates. `local` are the addresses to bind.
    pub(crate) async fn offer(
        local: Vec<SocketAddr>,
        mode: ChannelMode,
    ) -> Result<(Self, String), CallError> {
        let mut peer = Self::new(local, mode, FEEDBACK, MOTION).await?;
        let offer = peer.connection.create_offer(None).await?;
        let sdp = peer.describe(offer).await?;
        Ok((peer, sdp))
    }

    /// Answers an offer as a sender.
    pub(crate) async fn answer(
        local: Vec<SocketAddr>,
        mode: ChannelMode,
        offer: String,
    ) -> Result<(Self, String), CallError> {
        let mut peer = Self::new(local, mode, MOTION, FEEDBACK).await?;
        let offer = RTCSessionDescription::offer(offer)?;
        peer.connection.set_remote_description(offer).await?;
        let answer = peer.connection.create_answer(None).await?;
        let sdp = peer.describe(answer).await?;
        Ok((peer, sdp))
    }

    /// Takes the other side's answer to this side's offer.
    pub(crate) async fn accept(&self, answer: String) -> Result<(), CallError> {
        let answer = RTCSessionDescription::answer(answer)?;
        Ok(self.connection.set_remote_description(answer).await?)
    }

    async fn new(
        local: Vec<SocketAddr>,
        mode: ChannelMode,
        own: (u16, &str),
        other: (u16, &str),
    ) -> Result<Self, CallError> {
        let [disconnected, failed, keep_alive] = ICE_TIMEOUTS.map(Some);
        let settings = SettingEngineBuilder::new()
            // It needs port 5353, and a local name tells a viewer elsewhere nothing.
            .with_multicast_dns_mode(MulticastDnsMode::Disabled)
            .with_ice_timeouts(disconnected, failed, keep_alive)
            .with_dtls_cipher_suites(CIPHERS.to_vec())
            .with_host_acceptance_min_wait(None)
            // Here who begins DTLS begins SCTP too; elsewhere (aiortc) it is who offered. So both are the viewer.
            .with_answering_dtls_role(RTCDtlsRole::Server)
            .build();
        let (fail, failed) = watch::channel(false);
        let (gathered_now, gathered) = mpsc::channel(1);
        let connection = PeerConnectionBuilder::new()
            .with_configuration(RTCConfigurationBuilder::new().build())
            .with_setting_engine(settings)
            .with_handler(Arc::new(Handler {
                failed: fail,
                gathered: gathered_now,
            }))
            .with_udp_addrs(local)
            .with_data_channel_send_buffer_limit(SEND_BUFFER)
            .build()
            .await?;
        let connection: Arc<dyn PeerConnection> = Arc::new(connection);
        let own = open(&connection, mode, own).await?;
        let other = open(&connection, mode, other).await?;
        let (tell, events) = mpsc::channel(WAITING);
        tokio::spawn(listen(Arc::clone(&own), other, failed, tell));
        Ok(Self {
            connection,
            own,
            events,
            gathered,
        })
    }

    /// Takes `description` for this side's own and returns it with all candidates.
    async fn describe(&mut self, description: RTCSessionDescription) -> Result<String, CallError> {
        self.connection.set_local_description(description).await?;
        // What has been gathered by then is offered.
        let _ = tokio::time::timeout(GATHERING, self.gathered.recv()).await;
        let description = self.connection.local_description().await;
        Ok(description.ok_or(CallError::NoDescription)?.sdp)
    }

    /// Waits until the channel is open.
    pub(crate) async fn opened(&mut self) -> Result<(), CallError> {
        loop {
            match self.next().await {
                PeerEvent::Open => return Ok(()),
                PeerEvent::Closed => return Err(CallError::NotConnected),
                PeerEvent::Message(_) => {}
            }
        }
    }

    /// The next event. After [`PeerEvent::Closed`] there is nothing more.
    pub(crate) async fn next(&mut self) -> PeerEvent {
        self.events.recv().await.unwrap_or(PeerEvent::Closed)
    }

    /// Sends `message` unless too much is waiting.
    pub(crate) async fn try_send(&self, message: &[u8]) -> Sent {
        match self.own.try_send(BytesMut::from(message)).await {
            Ok(()) => Sent::Queued,
            Err(Error::ErrSendBufferFull) => Sent::Skipped,
            Err(_) => Sent::Closed,
        }
    }

    /// Closes the connection, telling the other side.
    pub(crate) async fn close(&self) {
        let _ = self.own.close().await;
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

/// Makes one of the channels.
async fn open(
    connection: &Arc<dyn PeerConnection>,
    mode: ChannelMode,
    (id, label): (u16, &str),
) -> Result<Arc<dyn DataChannel>, CallError> {
    let unreliable = mode == ChannelMode::Unreliable;
    let init = RTCDataChannelInit {
        ordered: !unreliable,
        max_retransmits: unreliable.then_some(0),
        protocol: PROTOCOL.to_owned(),
        negotiated: Some(id),
        ..RTCDataChannelInit::default()
    };
    Ok(connection.create_data_channel(label, Some(init)).await?)
}

/// Reads the other side's channel, until one of both is closed, the connection fails, or nobody listens any more.
async fn listen(
    own: Arc<dyn DataChannel>,
    other: Arc<dyn DataChannel>,
    mut failed: watch::Receiver<bool>,
    tell: mpsc::Sender<PeerEvent>,
) {
    loop {
        let event = tokio::select! {
            event = own.poll() => event,
            event = other.poll() => match event {
                // Only this side's own tells that it may speak.
                Some(DataChannelEvent::OnOpen) => continue,
                event => event,
            },
            () = raised(&mut failed) => None,
        };
        let told = match event {
            Some(DataChannelEvent::OnOpen) => tell.try_send(PeerEvent::Open),
            Some(DataChannelEvent::OnMessage(message)) => {
                if message.data.len() > LARGEST_MESSAGE {
                    log::debug!("a message of {} bytes is dropped", message.data.len());
                    continue;
                }
                tell.try_send(PeerEvent::Message(message.data.freeze()))
            }
            Some(DataChannelEvent::OnClose | DataChannelEvent::OnClosing) | None => {
                // Nobody listening is as good.
                let _ = tell.send(PeerEvent::Closed).await;
                return;
            }
            Some(_) => continue,
        };
        match told {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(_)) => {
                log::debug!("a message is dropped: too many wait");
            }
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
    }
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
            let (mut viewer, offer) = Peer::offer(loopback(), mode).await.expect("an offer");
            let (mut sender, answer) = Peer::answer(loopback(), mode, offer)
                .await
                .expect("an answer");
            viewer.accept(answer).await.expect("a good answer");
            for peer in [&mut viewer, &mut sender] {
                peer.opened().await.expect("an open channel");
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
}
