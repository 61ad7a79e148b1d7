//! The voice's track on a connection: Opus over RTP, from the side that answers to the side that offers. This file and `peer.rs` alone use
//! the `webrtc` crate.

use crate::CallError;
use crate::sdp::{Description, Direction, Media, Part};
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
pub(crate) fn asked_for(offer: &Description) -> Option<u8> {
    let may_receive = |part: &&Part| {
        let direction = part.direction;
        let is_closed = matches!(direction, Some(Direction::Neither | Direction::Sends));
        part.media == Media::Audio && part.is_used() && !is_closed
    };
    let mut maps = (offer.parts.iter())
        .filter(may_receive)
        .flat_map(|part| &part.rtp_maps);
    let opus =
        maps.find(|map| map.codec.eq_ignore_ascii_case("opus") && map.rate == link_voice::RATE);
    opus.map(|map| map.payload_type)
}

/// A packet that arrived, as far as RTP tells.
#[derive(Debug, Clone)]
pub(crate) struct VoicePacket {
    /// In samples of 48 kHz.
    pub(crate) timestamp: u32,
    /// An Opus frame, or what a stranger sent for one.
    pub(crate) opus: Bytes,
}

impl VoicePacket {
    /// Of RTP, unless it cannot be Opus by its size.
    pub(crate) fn of(packet: rtp::Packet) -> Option<Self> {
        let bytes = packet.payload.len();
        if bytes == 0 || bytes > link_voice::MAX_PACKET_BYTES {
            log::debug!("{bytes} bytes are no packet of voice");
            return None;
        }
        Some(Self {
            timestamp: packet.header.timestamp,
            opus: packet.payload,
        })
    }
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
        let ssrc = getrandom::u32()?;
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
            sequence: AtomicU16::new((getrandom::u32()? & 0x7fff) as u16),
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
    use link_codec::Micros;
    use link_voice::{
        FRAME, FRAME_US, RATE, Voice, VoiceEncoder, VoicePlayer, VoiceQueue, timestamp,
    };
    use rtc::shared::marshal::{Marshal, Unmarshal};
    use std::time::Duration;

    #[test]
    fn an_offer_says_whether_it_asks_for_a_voice_and_by_which_number() {
        let asked = |port: &str, lines: &str| {
            let text = format!(
                "v=0\r\nm=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\na=sendrecv\r\n\
                 m=audio {port} UDP/TLS/RTP/SAVPF 0 96\r\na=rtpmap:0 PCMU/8000\r\n{lines}\r\n"
            );
            asked_for(&Description::read(&text).expect("an offer"))
        };
        let opus = "a=rtpmap:96 OPUS/48000/2";
        assert_eq!(asked("9", opus), Some(96), "with Opus");
        let receives = format!("{opus}\r\na=recvonly");
        assert_eq!(asked("9", &receives), Some(96), "receiving");
        assert_eq!(asked("0", opus), None, "not used");
        assert_eq!(asked("9", "a=recvonly"), None, "without Opus");
        for direction in ["a=inactive", "a=sendonly"] {
            let lines = format!("{direction}\r\n{opus}");
            assert_eq!(asked("9", &lines), None, "{direction}");
        }
    }

    /// What a stranger may do to a packet on its way: bits turned, cut short, made longer.
    fn spoilt(packet: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
        let mut bytes = packet.to_vec();
        match random.u8(0..4) {
            0 => bytes.truncate(random.usize(0..=packet.len())),
            1 => bytes.extend(vec![random.u8(..); random.usize(1..2_000)]),
            2 => bytes[random.usize(0..12)] = random.u8(..),
            _ => {
                for _ in 0..random.usize(1..10) {
                    bytes[random.usize(0..packet.len())] ^= 1 << random.u8(0..8);
                }
            }
        }
        bytes
    }

    /// 20 ms of a voice.
    fn spoken(random: &mut fastrand::Rng) -> [f32; FRAME] {
        std::array::from_fn(|k| (k as f32 * 0.03).sin() * random.f32())
    }

    /// RTP of a frame's packet, or of a byte where the encoder has none.
    fn rtp_of(opus: Option<Bytes>, number: u64, captured: Micros) -> Vec<u8> {
        let packet = rtp::Packet {
            header: rtp::Header {
                version: 2,
                payload_type: PAYLOAD_TYPE,
                sequence_number: (number & 0xffff) as u16,
                timestamp: timestamp::from_time(captured),
                ssrc: 7,
                ..rtp::Header::default()
            },
            payload: opus.unwrap_or_else(|| Bytes::from_static(&[8])),
        };
        packet.marshal().expect("a packet").to_vec()
    }

    /// What a viewer does with bytes that arrive; whether they were taken for a packet of voice.
    fn arrive(bytes: Vec<u8>, now: Micros, queue: &VoiceQueue) -> bool {
        let packet = rtp::Packet::unmarshal(&mut Bytes::from(bytes)).ok();
        let Some(VoicePacket { timestamp, opus }) = packet.and_then(VoicePacket::of) else {
            return false;
        };
        let captured = timestamp::to_time(timestamp, now);
        queue.push(Voice { captured, opus }, now);
        true
    }

    /// Plays 20 ms; the loudest sample of them.
    fn loudest(player: &mut VoicePlayer, now: Micros) -> f32 {
        let mut out = [0.0; FRAME];
        player.play(now, Duration::ZERO, &mut out);
        assert!(out.iter().all(|sample| sample.is_finite()), "at {now:?}");
        out.iter().fold(0.0, |most, sample| most.max(sample.abs()))
    }

    #[test]
    fn spoilt_rtp_is_no_trouble_for_who_listens() {
        let mut encoder = VoiceEncoder::new().expect("an encoder");
        let queue = VoiceQueue::default();
        let mut player = queue.listen().expect("a player");
        let mut random = fastrand::Rng::with_seed(4);
        let (mut refused, mut taken) = (0, 0);
        let mut held_up = Vec::new();
        for number in 0..10_000u64 {
            let now = Micros(60_000_000 + number * FRAME_US);
            let opus = encoder.encode(&spoken(&mut random)).expect("a packet");
            let mut bytes = rtp_of(opus, number, now);
            if random.u8(0..3) > 0 {
                bytes = spoilt(&bytes, &mut random);
            }
            held_up.push(bytes);
            // Some wait for others, and are overtaken by them.
            if random.bool() {
                random.shuffle(&mut held_up);
                for bytes in held_up.drain(..) {
                    if arrive(bytes, now, &queue) {
                        taken += 1;
                    } else {
                        refused += 1;
                    }
                }
            }
            loudest(&mut player, now);
        }
        let counts = queue.statistics().expect("it is played");
        println!("{taken} taken, {refused} refused, {counts:?}");
        assert!(refused > 300 && taken > 3_000, "{refused} and {taken}");
        assert!(counts.refused > 50 && counts.decoded > 2_000, "{counts:?}");
    }

    #[test]
    fn a_voice_goes_on_after_its_times_have_jumped() {
        let second_us = 1_000_000i64;
        let round_us = (1i64 << 32) * second_us / i64::from(RATE);
        for jump_us in [second_us, -second_us, 3_600 * second_us, round_us / 2 - 1] {
            // A stray packet, as many as are believed, and a second of them.
            for strays in [1, 6, 50] {
                let mut encoder = VoiceEncoder::new().expect("an encoder");
                let queue = VoiceQueue::default();
                let mut player = queue.listen().expect("a player");
                let mut random = fastrand::Rng::with_seed(4);
                let mut heard = 0;
                for number in 0..700u64 {
                    let now = Micros(90_000_000_000 + number * FRAME_US);
                    let strays = (100..100 + strays).contains(&number);
                    let captured = now
                        .0
                        .saturating_add_signed(if strays { jump_us } else { 0 });
                    let opus = encoder.encode(&spoken(&mut random)).expect("a packet");
                    arrive(rtp_of(opus, number, Micros(captured)), now, &queue);
                    let is_heard = loudest(&mut player, now) > 0.05;
                    heard += u32::from(is_heard && number >= 500);
                }
                println!(
                    "{jump_us} us, {strays} packets: {heard} of 200 heard; {:?}",
                    queue.statistics()
                );
                assert!(
                    heard > 190,
                    "{jump_us} us, {strays} packets: {heard} of 200"
                );
            }
        }
    }
}
