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

/// Opus' usual dynamic payload type. The side that offers says which is meant.
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

/// The payload type of Opus in an offer that asks for a voice: its first audio section that is used, may receive, and knows Opus.
pub(crate) fn asked_for(offer: &str) -> Option<u8> {
    let sections = offer.split("\nm=").skip(1);
    sections.filter_map(in_audio_section).next()
}

fn in_audio_section(section: &str) -> Option<u8> {
    let mut lines = section.lines().map(str::trim);
    let mut media = lines.next()?.split_whitespace();
    let is_used = media.next() == Some("audio") && media.next() != Some("0");
    let lines: Vec<&str> = lines.collect();
    let may_receive = !lines
        .iter()
        .any(|line| matches!(*line, "a=inactive" | "a=sendonly"));
    let opus = lines.iter().find_map(|line| {
        let (number, codec) = line.strip_prefix("a=rtpmap:")?.split_once(' ')?;
        codec
            .to_ascii_lowercase()
            .starts_with("opus/48000")
            .then(|| number.parse().ok())
            .flatten()
    });
    opus.filter(|_| is_used && may_receive)
}

/// The sending end.
pub(crate) struct OutgoingVoice {
    track: Arc<TrackLocalStaticRTP>,
    payload_type: u8,
    ssrc: u32,
    sequence: AtomicU16,
}

impl OutgoingVoice {
    /// For an offer that asks for a voice with this payload type, before it is answered.
    pub(crate) async fn add(
        connection: &Arc<dyn PeerConnection>,
        payload_type: u8,
    ) -> Result<Self, CallError> {
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
            payload_type,
            ssrc,
            // Below half the range: a wrap soon after the start would confuse SRTP (RFC 3711, section 3.3.1).
            sequence: AtomicU16::new((random()? & 0x7fff) as u16),
        })
    }

    /// Hands a packet to the network; whether it was taken. Without a connection it is lost, as on a bad network.
    pub(crate) async fn send(&self, timestamp: u32, opus: Bytes) -> bool {
        let packet = rtp::Packet {
            header: rtp::Header {
                version: 2,
                payload_type: self.payload_type,
                sequence_number: self.sequence.fetch_add(1, Relaxed),
                timestamp,
                ssrc: self.ssrc,
                ..rtp::Header::default()
            },
            payload: opus,
        };
        let sent = self.track.write_rtp(packet).await;
        if let Err(error) = &sent {
            log::debug!("a packet of voice is not sent: {error}");
        }
        sent.is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offer_says_whether_it_asks_for_a_voice_and_by_which_number() {
        let offer = |port: &str, lines: &str| {
            format!(
                "v=0\r\nm=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\na=sendrecv\r\n\
                 m=audio {port} UDP/TLS/RTP/SAVPF 0 96\r\na=rtpmap:0 PCMU/8000\r\n{lines}\r\n"
            )
        };
        let opus = "a=rtpmap:96 OPUS/48000/2";
        assert_eq!(asked_for(&offer("9", opus)), Some(96), "with Opus");
        let receives = format!("{opus}\r\na=recvonly");
        assert_eq!(asked_for(&offer("9", &receives)), Some(96), "receiving");
        assert_eq!(asked_for(&offer("0", opus)), None, "not used");
        assert_eq!(asked_for(&offer("9", "a=recvonly")), None, "without Opus");
        for direction in ["a=inactive", "a=sendonly"] {
            let lines = format!("{direction}\r\n{opus}");
            assert_eq!(asked_for(&offer("9", &lines)), None, "{direction}");
        }
        assert_eq!(asked_for("v=0\r\nm=application 9 x y\r\n"), None, "none");
        assert_eq!(asked_for("\nm="), None, "no sense");
    }
}
