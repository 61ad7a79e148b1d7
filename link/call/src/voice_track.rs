//! The voice's track on a connection: Opus over RTP, from the side that answers to the side that offers. This file and `peer.rs` alone use
//! the `webrtc` crate.

use crate::CallError;
use bytes::Bytes;
use rtc::media_stream::MediaStreamTrack;
use rtc::peer_connection::configuration::media_engine::{MIME_TYPE_OPUS, MediaEngine};
use rtc::rtp;
use rtc::rtp_transceiver::rtp_sender::{
    RTCRtpCodec, RTCRtpCodecParameters, RTCRtpCodingParameters, RTCRtpEncodingParameters,
    RtpCodecKind,
};
use rtc::rtp_transceiver::{RTCRtpTransceiverDirection, RTCRtpTransceiverInit};
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering::Relaxed};
use webrtc::media_stream::track_local::TrackLocal;
use webrtc::media_stream::track_local::static_rtp::TrackLocalStaticRTP;
use webrtc::peer_connection::PeerConnection;

/// Opus' usual dynamic payload type; both sides follow the SDP.
const PAYLOAD_TYPE: u8 = 111;

/// Opus alone, one channel (its name has two always, RFC 7587), with copies against losses and pauses in silence.
fn codec() -> RTCRtpCodec {
    RTCRtpCodec {
        mime_type: MIME_TYPE_OPUS.to_owned(),
        clock_rate: link_voice::RATE,
        channels: 2,
        sdp_fmtp_line: "minptime=20;useinbandfec=1;usedtx=1".to_owned(),
        rtcp_feedback: Vec::new(),
    }
}

/// What the connection may carry.
pub(crate) fn media_engine() -> Result<MediaEngine, CallError> {
    let mut engine = MediaEngine::default();
    let opus = RTCRtpCodecParameters {
        rtp_codec: codec(),
        payload_type: PAYLOAD_TYPE,
    };
    engine.register_codec(opus, RtpCodecKind::Audio)?;
    Ok(engine)
}

/// Asks for a voice, in an offer that is still to be made.
pub(crate) async fn ask_for(connection: &Arc<dyn PeerConnection>) -> Result<(), CallError> {
    let init = RTCRtpTransceiverInit {
        direction: RTCRtpTransceiverDirection::Recvonly,
        ..RTCRtpTransceiverInit::default()
    };
    connection
        .add_transceiver_from_kind(RtpCodecKind::Audio, Some(init))
        .await?;
    Ok(())
}

/// The sending end.
pub(crate) struct OutgoingVoice {
    track: Arc<TrackLocalStaticRTP>,
    ssrc: u32,
    sequence: AtomicU16,
}

impl OutgoingVoice {
    /// For an offer that asks for a voice, before it is answered.
    pub(crate) async fn add(connection: &Arc<dyn PeerConnection>) -> Result<Self, CallError> {
        let random = || getrandom::u32().map_err(|error| CallError::Random(error.to_string()));
        let ssrc = random()?;
        let track = Arc::new(TrackLocalStaticRTP::new(MediaStreamTrack::new(
            "mon3tr".to_owned(),
            "voice".to_owned(),
            "voice".to_owned(),
            RtpCodecKind::Audio,
            vec![RTCRtpEncodingParameters {
                rtp_coding_parameters: RTCRtpCodingParameters {
                    ssrc: Some(ssrc),
                    ..RTCRtpCodingParameters::default()
                },
                codec: codec(),
                ..RTCRtpEncodingParameters::default()
            }],
        )));
        connection
            .add_track(Arc::clone(&track) as Arc<dyn TrackLocal>)
            .await?;
        Ok(Self {
            track,
            ssrc,
            // From half the range on: a wrap soon after the start would confuse SRTP (RFC 3711, section 3.3.1).
            sequence: AtomicU16::new((random()? & 0x7fff) as u16),
        })
    }

    /// Sends a packet. Without a connection it is lost, as on a bad network.
    pub(crate) async fn send(&self, timestamp: u32, opus: Bytes) {
        let packet = rtp::Packet {
            header: rtp::Header {
                version: 2,
                payload_type: PAYLOAD_TYPE,
                sequence_number: self.sequence.fetch_add(1, Relaxed),
                timestamp,
                ssrc: self.ssrc,
                ..rtp::Header::default()
            },
            payload: opus,
        };
        if let Err(error) = self.track.write_rtp(packet).await {
            log::debug!("a packet of voice is not sent: {error}");
        }
    }
}
