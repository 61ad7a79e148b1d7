//! One WebRTC connection with its two data channels and the voice's track. This file, `nudge.rs`, `screening/` and
//! `voice_track.rs` alone use the `webrtc` crate.

use crate::nudge::Nudge;
use crate::path::{CandidateKind, Path, PathEnd};
use crate::plan::{Plan, Relay};
use crate::screening::Screening;
use crate::sdp::{Candidate, Description, Fingerprints, Host};
use crate::voice_track::{self, OutgoingVoice, VoicePacket};
use crate::{CallError, candidates, is_set};
use bytes::{Bytes, BytesMut};
use link_protocol::announcement::ChannelMode;
use link_protocol::data_channel::{
    Channel, FEEDBACK_CHANNEL, MOTION_CHANNEL, Message, SUBPROTOCOL,
};
use link_protocol::limits::MAX_MESSAGE_BYTES;
use rtc::ice::mdns::MulticastDnsMode;
use rtc::mdns::MulticastSocket;
use rtc::peer_connection::transport::RTCDtlsRole;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use webrtc::data_channel::{DataChannel, DataChannelEvent, RTCDataChannelInit};
use webrtc::error::Error;
use webrtc::media_stream::track_remote::{TrackRemote, TrackRemoteEvent};
use webrtc::peer_connection::{
    CipherSuiteId, PeerConnection, PeerConnectionBuilder, PeerConnectionEventHandler,
    RTCConfigurationBuilder, RTCIceCandidateType, RTCIceGatheringState, RTCIceServer,
    RTCPeerConnectionIceEvent, RTCPeerConnectionState, RTCSessionDescription, SettingEngineBuilder,
};

/// Bytes that may wait to be sent: some eight motion frames. The default, no limit, would let seconds of old motion wait before the
/// newest on a slow network.
const SEND_BUFFER: usize = 4_000;

/// Bytes of messages that came in pieces or out of order and wait for the rest: eight times what the other side may
/// have on its way.
const RECEIVE_BUFFER: u32 = 32 << 10;

/// Messages that may wait to be read, and packets of voice beside them; more are dropped. A flood of one does not touch the other.
const MAX_WAITING: usize = 256;
const MAX_VOICE_WAITING: usize = 64;

/// ICE: silence until a connection counts as disconnected, until it has failed, and between keep-alives. The absence of
/// motion or feedback shows sooner that a peer is gone, so these may be slow: keep-alives every half second take 5 kbit/s each way.
const ICE_TIMEOUTS: [Duration; 3] = [
    Duration::from_secs(5),
    Duration::from_secs(10),
    Duration::from_secs(2),
];

/// In order of preference. The first one's records are 8 bytes shorter, because it sends no nonce; browsers have it.
const CIPHERS: [CipherSuiteId; 2] = [
    CipherSuiteId::Tls_Ecdhe_Ecdsa_With_ChaCha20_Poly1305_Sha256,
    CipherSuiteId::Tls_Ecdhe_Ecdsa_With_Aes_128_Gcm_Sha256,
];

/// How long servers may take to tell this side's addresses, or to lend it one; what a server tells of one of this machine's addresses, it
/// tells of all of them that lead anywhere within the shorter time.
const GATHER_TIMEOUT: Duration = Duration::from_secs(2);
const GATHER_REST: Duration = Duration::from_millis(200);

/// How long the side that chooses waits for a better path than one through a NAT, and one by a relay: a direct one is found in the time of
/// two round trips.
const NAT_WAIT: Duration = Duration::from_millis(200);
const RELAY_WAIT: Duration = Duration::from_millis(600);

/// What happens on a connection.
#[derive(Debug)]
pub(crate) enum PeerEvent {
    /// The channel is open.
    Open,
    /// A message arrived.
    Message(Bytes),
    /// A packet of voice arrived.
    Voice(VoicePacket),
    /// The other side closed the channel, or the connection failed.
    Closed,
}

/// The outcome of sending a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SendOutcome {
    /// It waits to be sent.
    Queued,
    /// Too much is waiting already: skipped.
    Skipped,
    /// The channel is closed.
    Closed,
}

/// One end of a connection. Dropping it closes it in the background.
pub(crate) struct Peer {
    connection: Arc<dyn PeerConnection>,
    /// The channel that this side sends on.
    outgoing: Arc<dyn DataChannel>,
    /// Of the side that answers, if the other side asked for it.
    voice: Option<OutgoingVoice>,
    events: mpsc::Receiver<PeerEvent>,
    heard: mpsc::Receiver<VoicePacket>,
    gathered: watch::Receiver<Gathered>,
    /// The relay among its servers.
    relay: Option<Relay>,
    /// Whether it is bound to the machine's loopback.
    is_local: bool,
    screening: Screening,
    /// The other side's certificate, as it signed it; nothing before its description is taken.
    signed: Option<Fingerprints>,
    /// While packets may go by it.
    nudge: Option<Nudge>,
}

/// How far the search for this side's addresses is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Gathered {
    /// There is an address as a server sees it; one that a server lends.
    reflexive: bool,
    lent: bool,
    complete: bool,
}

impl std::fmt::Debug for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Peer").finish_non_exhaustive()
    }
}

/// Receives the callbacks of the connection's driver. Never waits, because it runs in the driver's own task.
struct Handler {
    failed: watch::Sender<bool>,
    gathered: watch::Sender<Gathered>,
    /// Where the other side's voice goes: of the side that asked for one, until its track is there.
    voice: Mutex<Option<mpsc::Sender<VoicePacket>>>,
}

#[async_trait::async_trait]
impl PeerConnectionEventHandler for Handler {
    async fn on_ice_gathering_state_change(&self, state: RTCIceGatheringState) {
        if state == RTCIceGatheringState::Complete {
            self.gathered
                .send_modify(|gathered| gathered.complete = true);
        }
    }

    async fn on_ice_candidate(&self, event: RTCPeerConnectionIceEvent) {
        self.gathered
            .send_modify(|gathered| match event.candidate.typ {
                RTCIceCandidateType::Srflx => gathered.reflexive = true,
                RTCIceCandidateType::Relay => gathered.lent = true,
                _ => {}
            });
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

    async fn on_track(&self, track: Arc<dyn TrackRemote>) {
        let voice = self
            .voice
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(voice) = voice {
            tokio::spawn(listen_to_voice(track, voice));
        }
    }
}

impl Peer {
    /// Begins a call as a viewer: returns the offer with all candidates.
    pub(crate) async fn offer(plan: Plan, mode: ChannelMode) -> Result<(Self, String), CallError> {
        let mdns = MulticastDnsMode::Disabled;
        let mut peer = Self::new(plan, mode, FEEDBACK_CHANNEL, MOTION_CHANNEL, mdns).await?;
        voice_track::ask_for(&peer.connection).await?;
        let offer = peer.connection.create_offer(None).await?;
        let sdp = peer.describe(offer).await?;
        Ok((peer, sdp))
    }

    /// Answers an offer as a sender.
    pub(crate) async fn answer(
        plan: Plan,
        mode: ChannelMode,
        offer: &Description,
    ) -> Result<(Self, String), CallError> {
        let is_local = candidates::has_loopback(&plan.local);
        let tried = candidates::screened(&offer.candidates, is_local);
        let mdns = mdns_for(&tried);
        let text = offer.write(tried)?;
        let mut peer = Self::new(plan, mode, MOTION_CHANNEL, FEEDBACK_CHANNEL, mdns).await?;
        peer.signed = Some(offer.fingerprints()?.clone());
        let voice = voice_track::asked_for(offer);
        let offer = RTCSessionDescription::offer(text)?;
        peer.connection.set_remote_description(offer).await?;
        if let Some(payload_type) = voice {
            match OutgoingVoice::add(&peer.connection, payload_type).await {
                Ok(voice) => peer.voice = Some(voice),
                Err(error) => log::warn!("a viewer gets no voice: {error}"),
            }
        }
        let answer = peer.connection.create_answer(None).await?;
        let sdp = peer.describe(answer).await?;
        Ok((peer, sdp))
    }

    /// Takes the other side's answer to this side's offer.
    pub(crate) async fn accept(&mut self, answer: &Description) -> Result<(), CallError> {
        let tried = candidates::screened(&answer.candidates, self.is_local);
        self.signed = Some(answer.fingerprints()?.clone());
        let answer = RTCSessionDescription::answer(answer.write(tried)?)?;
        Ok(self.connection.set_remote_description(answer).await?)
    }

    async fn new(
        plan: Plan,
        mode: ChannelMode,
        outgoing: Channel,
        incoming: Channel,
        mdns: MulticastDnsMode,
    ) -> Result<Self, CallError> {
        let [disconnected, lost, keep_alive] = ICE_TIMEOUTS.map(Some);
        let (fail, failed) = watch::channel(false);
        let screening = Screening::new(fail.clone());
        let settings = SettingEngineBuilder::new()
            .with_crypto_provider(screening.crypto()?)
            .with_sctp_max_receive_buffer_size(RECEIVE_BUFFER)
            .with_multicast_dns_mode(mdns)
            .with_ice_timeouts(disconnected, lost, keep_alive)
            .with_dtls_cipher_suites(CIPHERS.to_vec())
            .with_host_acceptance_min_wait(None)
            .with_srflx_acceptance_min_wait(Some(NAT_WAIT))
            .with_prflx_acceptance_min_wait(Some(NAT_WAIT))
            .with_relay_acceptance_min_wait(Some(RELAY_WAIT))
            // In this library the DTLS client starts SCTP, in others (aiortc) the offering side does. With the answering side as DTLS
            // server, the viewer is both.
            .with_answering_dtls_role(RTCDtlsRole::Server)
            .build();
        let is_local = candidates::has_loopback(&plan.local);
        let (gather, gathered) = watch::channel(Gathered::default());
        let servers: Vec<RTCIceServer> = plan
            .servers
            .into_iter()
            .map(|server| RTCIceServer {
                urls: server.urls,
                username: server.username.unwrap_or_default(),
                credential: server.credential.unwrap_or_default(),
            })
            .collect();
        let configuration = RTCConfigurationBuilder::new().with_ice_servers(servers);
        let (events, received) = mpsc::channel(MAX_WAITING);
        let (hear, heard) = mpsc::channel(MAX_VOICE_WAITING);
        let connection = PeerConnectionBuilder::new()
            .with_runtime(screening.runtime())
            .with_configuration(configuration.build())
            .with_setting_engine(settings)
            .with_media_engine(voice_track::media_engine()?)
            .with_handler(Arc::new(Handler {
                failed: fail,
                gathered: gather,
                voice: Mutex::new((incoming == MOTION_CHANNEL).then_some(hear)),
            }))
            .with_udp_addrs(plan.local)
            .with_data_channel_send_buffer_limit(SEND_BUFFER)
            .build()
            .await?;
        let connection: Arc<dyn PeerConnection> = Arc::new(connection);
        let outgoing = open(&connection, mode, outgoing).await?;
        let incoming = open(&connection, mode, incoming).await?;
        tokio::spawn(listen(Arc::clone(&outgoing), incoming, failed, events));
        let nudge = (plan.relay.as_ref()).map(|_| Nudge::begin(Arc::clone(&outgoing)));
        Ok(Self {
            connection,
            outgoing,
            voice: None,
            events: received,
            heard,
            gathered,
            nudge,
            relay: plan.relay,
            is_local,
            screening,
            signed: None,
        })
    }

    /// Takes `description` for this side's own and returns it with all candidates.
    async fn describe(&mut self, description: RTCSessionDescription) -> Result<String, CallError> {
        let described = Description::read(&description.sdp)?;
        self.screening.describe(described.ice_name()?);
        self.connection.set_local_description(description).await?;
        // After the timeout the candidates gathered so far are offered.
        let (relay, mut gathered) = (self.relay.is_some(), self.gathered.clone());
        let enough = async {
            let first = |it: &Gathered| it.complete || it.lent || (it.reflexive && !relay);
            let found = gathered.wait_for(first).await.is_ok_and(|it| it.complete);
            if !found {
                let rest = gathered.wait_for(|it| it.complete);
                let _ = tokio::time::timeout(GATHER_REST, rest).await;
            }
        };
        let _ = tokio::time::timeout(GATHER_TIMEOUT, enough).await;
        let description = self.connection.local_description().await;
        Ok(description.ok_or(CallError::NoDescription)?.sdp)
    }

    /// Whether the other side of the connection has the certificate that it signed. The library compares one of its
    /// fingerprints by itself; this does not depend on how the library read the description.
    async fn check_certificate(&self) -> Result<(), CallError> {
        let transport = self.connection.sctp().await;
        let transport = transport.ok_or(CallError::NotConnected)?.transport();
        let certificates = transport.get_remote_certificates().await?;
        let certificate = certificates.first().ok_or(CallError::OtherCertificate)?;
        let is_signed = |signed: &Fingerprints| signed.are_of(certificate);
        let checked = self.signed.as_ref().is_some_and(is_signed);
        checked.then_some(()).ok_or(CallError::OtherCertificate)
    }

    /// Waits until the channel is open to the side that signed its description. What came before is dropped.
    pub(crate) async fn opened(&mut self) -> Result<(), CallError> {
        loop {
            match self.next().await {
                PeerEvent::Open => {
                    if let Err(error) = self.check_certificate().await {
                        self.close().await;
                        return Err(error);
                    }
                    let path = self.path().await;
                    if path.is_some_and(|path| path.relay.is_none()) {
                        self.nudge = None;
                    }
                    return Ok(());
                }
                PeerEvent::Closed => return Err(CallError::NotConnected),
                PeerEvent::Message(_) | PeerEvent::Voice(_) => {}
            }
        }
    }

    /// Waits until the channel is open and the viewer's first feedback has told the session's number.
    pub(crate) async fn introduced(&mut self) -> Result<u32, CallError> {
        self.opened().await?;
        loop {
            match self.next().await {
                PeerEvent::Message(bytes) => {
                    if let Some(session) = Message::session_of_feedback(&bytes) {
                        return Ok(session);
                    }
                }
                PeerEvent::Closed => return Err(CallError::NotConnected),
                PeerEvent::Open | PeerEvent::Voice(_) => {}
            }
        }
    }

    /// The way that the connection takes; nothing before it is open.
    pub(crate) async fn path(&self) -> Option<Path> {
        let transport = self.connection.sctp().await?.transport().ice_transport();
        let pair = transport.get_selected_candidate_pair().await.ok()??;
        let [local, remote] = [pair.local(), pair.remote()].map(|candidate| {
            let kind = match candidate.typ {
                RTCIceCandidateType::Srflx => CandidateKind::ServerReflexive,
                RTCIceCandidateType::Prflx => CandidateKind::PeerReflexive,
                RTCIceCandidateType::Relay => CandidateKind::Relay,
                _ => CandidateKind::Host,
            };
            let ip = candidate.address.parse().ok()?;
            let address = SocketAddr::new(ip, candidate.port);
            Some(PathEnd { kind, address })
        });
        let local = local?;
        // A host's own address has no other beneath it.
        let base = pair.local().related_address.parse();
        let relay = self.relay.clone();
        Some(Path {
            local,
            remote: remote?,
            base: base.unwrap_or(local.address.ip()),
            relay_offered: relay.is_some(),
            relay: relay.filter(|_| local.kind == CandidateKind::Relay),
        })
    }

    /// The next event. After [`PeerEvent::Closed`] there is nothing more.
    pub(crate) async fn next(&mut self) -> PeerEvent {
        tokio::select! {
            event = self.events.recv() => event.unwrap_or(PeerEvent::Closed),
            Some(voice) = self.heard.recv() => PeerEvent::Voice(voice),
        }
    }

    /// A packet of voice that has arrived, if there is one.
    pub(crate) fn voice_that_waits(&mut self) -> Option<VoicePacket> {
        self.heard.try_recv().ok()
    }

    /// Sends `message` unless too many bytes wait to be sent.
    pub(crate) async fn try_send(&self, message: &[u8]) -> SendOutcome {
        match self.outgoing.try_send(BytesMut::from(message)).await {
            Ok(()) => SendOutcome::Queued,
            Err(Error::ErrSendBufferFull) => SendOutcome::Skipped,
            Err(_) => SendOutcome::Closed,
        }
    }

    /// Hands a packet of voice to the network, if the other side asked for it; whether it was taken.
    pub(crate) async fn send_voice(&self, timestamp: u32, opus: Bytes) -> bool {
        match &self.voice {
            Some(voice) => voice.send(timestamp, opus).await,
            None => false,
        }
    }

    /// Closes the connection, telling the other side.
    pub(crate) async fn close(&self) {
        let _ = self.outgoing.close().await;
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

/// Whether names of a browser that hides its addresses behind `.local` are to be looked up. That needs the port of multicast DNS, which a
/// bare network may not have, and is of no use where the other side has no such name.
fn mdns_for(tried: &[&Candidate]) -> MulticastDnsMode {
    let is_named = tried.iter().any(|it| matches!(it.host, Host::Mdns(_)));
    if is_named && MulticastSocket::new().into_std().is_ok() {
        MulticastDnsMode::QueryOnly
    } else {
        MulticastDnsMode::Disabled
    }
}

/// Makes one of the channels. Both are negotiated beforehand: the library would send reliably, whatever was asked for, on a channel that
/// the other side opened in-band, and on one that the other side used first.
async fn open(
    connection: &Arc<dyn PeerConnection>,
    mode: ChannelMode,
    channel: Channel,
) -> Result<Arc<dyn DataChannel>, CallError> {
    let unreliable = mode == ChannelMode::Unreliable;
    let init = RTCDataChannelInit {
        ordered: !unreliable,
        max_retransmits: unreliable.then_some(0),
        protocol: SUBPROTOCOL.to_owned(),
        negotiated: Some(channel.id),
        ..RTCDataChannelInit::default()
    };
    Ok(connection
        .create_data_channel(channel.label, Some(init))
        .await?)
}

/// Reads the incoming channel until one of both is closed, the connection fails, or the receiver of events is dropped.
async fn listen(
    outgoing: Arc<dyn DataChannel>,
    incoming: Arc<dyn DataChannel>,
    mut failed: watch::Receiver<bool>,
    events: mpsc::Sender<PeerEvent>,
) {
    loop {
        let event = tokio::select! {
            event = outgoing.poll() => event,
            event = incoming.poll() => match event {
                // The outgoing channel's opening is the one that allows sending.
                Some(DataChannelEvent::OnOpen) => continue,
                event => event,
            },
            () = is_set(&mut failed) => None,
        };
        let sent = match event {
            Some(DataChannelEvent::OnOpen) => events.try_send(PeerEvent::Open),
            Some(DataChannelEvent::OnMessage(message)) => {
                if message.data.len() > MAX_MESSAGE_BYTES {
                    log::debug!("a message of {} bytes is dropped", message.data.len());
                    continue;
                }
                events.try_send(PeerEvent::Message(message.data.freeze()))
            }
            Some(DataChannelEvent::OnClose | DataChannelEvent::OnClosing) | None => {
                // A dropped receiver needs no event.
                let _ = events.send(PeerEvent::Closed).await;
                return;
            }
            Some(_) => continue,
        };
        match sent {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(_)) => {
                log::debug!("a message is dropped: too many wait");
            }
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
    }
}

/// Hands over the packets of the other side's voice, until its track or their receiver ends.
async fn listen_to_voice(track: Arc<dyn TrackRemote>, voice: mpsc::Sender<VoicePacket>) {
    while let Some(event) = track.poll().await {
        let TrackRemoteEvent::OnRtpPacket(packet) = event else {
            continue;
        };
        let Some(packet) = VoicePacket::of(packet) else {
            continue;
        };
        match voice.try_send(packet) {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(_)) => {
                log::debug!("a packet of voice is dropped: too much waits");
            }
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
    }
}

#[cfg(test)]
mod tests;
