//! What comes over the network in a call.

use super::parts;
use bytes::Bytes;
use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
use link_protocol::announcement::Announcement;
use link_protocol::calls::{CallStatus, EnterRoom, OpenedCall};
use link_protocol::data_channel::{Feedback, Message, PersonState, Pong, State};
use link_protocol::ice::IceUrl;
use link_protocol::presence::PresenceEvent;
use link_protocol::room_link::ServerUrl;
use link_protocol::rooms::{OpenRoom, OpenedRoom, RoomStatus};
use link_protocol::sealed::{self, Header};
use link_protocol::{CallLink, IceServers, Name, PackageId, PersonName, Refusal, RoomLink, Token};
use link_voice::{FRAME, FRAME_US, Voice, VoiceEncoder, VoiceQueue};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::str::FromStr;
use std::time::Duration;

/// Messages of the data channels that are no frames. What is read is written as it was.
pub(crate) fn messages(bytes: &[u8]) {
    let session = bytes
        .get(1..5)
        .and_then(|part| part.try_into().ok())
        .map_or(0, u32::from_le_bytes);
    if let Some(message) = Message::read(bytes, session) {
        let mut again = Vec::new();
        message.write(session, &mut again);
        assert_eq!(
            Message::read(&again, session),
            Some(message),
            "as it was written"
        );
    }
    let _ = Message::session_of_feedback(bytes);
    if let Some((header, rest)) = Header::read(bytes) {
        let head = &bytes[..bytes.len() - rest.len()];
        assert_eq!(header.bytes(), head, "as it was written");
    }
    if let Some(lines) = sealed::read_seal(bytes, session) {
        let mut again = Vec::new();
        sealed::write_seal(session, lines, &mut again);
        assert_eq!(again, bytes, "as it was written");
    }
}

pub(crate) fn message_seeds() -> Vec<Vec<u8>> {
    let (asked, arrived, left) = (Micros(1), Micros(2), Micros(3));
    let all = [
        Message::Feedback(Feedback {
            newest: 7,
            received: u64::MAX,
            sent: Micros(9),
        }),
        Message::Pong(Pong {
            asked,
            arrived,
            left,
        }),
        Message::State(State {
            person: PersonState::default(),
            sent: Micros(4),
        }),
        Message::Forwarded { of: 5 },
        Message::Watching { viewers: 500 },
        Message::Bye,
    ];
    let mut seeds: Vec<Vec<u8>> = all
        .iter()
        .map(|message| {
            let mut bytes = Vec::new();
            message.write(3, &mut bytes);
            bytes
        })
        .collect();
    let mut seal = Vec::new();
    sealed::write_seal(3, "a=mon3tr-seal:c2FsdA 1 2 3\r\n", &mut seal);
    seeds.push(seal);
    let header = Header {
        session: 3,
        counter: 1,
    };
    seeds.push([&header.bytes()[..], &[0; 40]].concat());
    seeds
}

/// Motion frames, one after another: what came before decides what a later one means.
pub(crate) fn frames(bytes: &[u8]) {
    let mut decoder = Decoder::new(1);
    for part in parts(bytes) {
        if let Ok(frame) = decoder.decode(part) {
            let is_motion = frame.motion.values().iter().all(|value| value.is_finite());
            assert!(is_motion, "{frame:?}");
        }
    }
}

pub(crate) fn frame_seeds() -> Vec<Vec<u8>> {
    [Codec::Compact, Codec::Paper]
        .map(|codec| {
            let mut encoder = Encoder::new(codec, 1);
            let (mut all, mut out) = (Vec::new(), Vec::new());
            for sequence in 1..6u32 {
                let frame = MotionFrame {
                    sequence,
                    captured: Micros(u64::from(sequence) * 33_333),
                    ..MotionFrame::default()
                };
                encoder.encode(&frame, &mut out);
                encoder.acknowledge(sequence, u64::MAX);
                // Longer ones are of no use to a byte of length.
                all.push(u8::try_from(out.len()).unwrap_or(u8::MAX));
                all.extend(&out[..out.len().min(255)]);
            }
            all
        })
        .into()
}

/// Bodies of requests and answers, and events. What is read is written as it was.
pub(crate) fn json(bytes: &[u8]) {
    fn both<T: DeserializeOwned + Serialize>(text: &str) {
        if let Ok(read) = serde_json::from_str::<T>(text) {
            let again = serde_json::to_string(&read).expect("it is written");
            serde_json::from_str::<T>(&again).expect("as it was written");
        }
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    both::<Announcement>(text);
    both::<EnterRoom>(text);
    both::<CallStatus>(text);
    both::<OpenedCall>(text);
    both::<OpenRoom>(text);
    both::<OpenedRoom>(text);
    both::<RoomStatus>(text);
    both::<IceServers>(text);
    let (name, data) = text.split_once('\n').unwrap_or((text, ""));
    if let Ok(Some(event)) = PresenceEvent::read(name, data) {
        let (name, data) = event.write();
        let again = PresenceEvent::read(name, &data).expect("as it was written");
        assert_eq!(again, Some(event), "as it was written");
    }
    let _ = Refusal::read(text);
}

pub(crate) fn json_seeds() -> Vec<Vec<u8>> {
    let hash = "ab".repeat(32);
    let announcement = format!(
        r#"{{"avatar":{{"sha256":"{hash}","bytes":3}},"channel":"unreliable","codec":"compact","rate_hz":30.0}}"#
    );
    let ice = r#"[{"urls":["turn:h:3478?transport=udp"],"username":"1:r","credential":"c"}]"#;
    [
        format!(r#"{{"seats":[{{"room":"r1"}},{{"room":"r2","taken":{{"announcement":{announcement},"person":"Ada"}}}}]}}"#),
        announcement,
        format!(r#"{{"ice_servers":{ice}}}"#),
        ice.to_owned(),
        r#"{"room":"r","sender_token":"a","viewer_token":"b","expires":9}"#.to_owned(),
        r#"{"lifetime_s":3600}"#.to_owned(),
        "offer\n{\"session\":\"S1\",\"sdp\":\"v=0\",\"forwards\":true}".to_owned(),
        format!("ice\n{{\"ice_servers\":{ice}}}"),
        "v=0\r\na=mon3tr-refused:full\r\n".to_owned(),
    ]
    .map(String::into_bytes)
    .into()
}

/// Links, names and addresses that people and programs give. What is read is written as it was.
pub(crate) fn links(bytes: &[u8]) {
    fn both<T: FromStr + Display + PartialEq>(text: &str) {
        if let Ok(read) = text.parse::<T>() {
            let again = read.to_string().parse::<T>();
            assert!(again.is_ok_and(|again| again == read), "{text}");
        }
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    both::<RoomLink>(text);
    both::<CallLink>(text);
    both::<ServerUrl>(text);
    both::<Name>(text);
    both::<PersonName>(text);
    both::<PackageId>(text);
    both::<IceUrl>(text);
    let _ = Token::new(text);
}

pub(crate) fn link_seeds() -> Vec<Vec<u8>> {
    [
        "https://call.example:8480/base/rooms/r7#TOKEN:key=5pdklde64aon2xk4rdywth43am:secret=LdKS6Jo12w4ZIEkHlafB6A",
        "http://[::1]:8080/calls/c7#TOKEN:later=x",
        "turns:turn.example:443?transport=tcp",
        "stun:192.0.2.1",
        "Ada Lovelace",
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
    ]
    .map(|text| text.as_bytes().to_vec())
    .into()
}

/// Packets of voice as they come: the first byte of each says how far its time is from the last one's.
pub(crate) fn voice(bytes: &[u8]) {
    let queue = VoiceQueue::default();
    let Ok(mut player) = queue.listen() else {
        return;
    };
    let (mut now, mut captured) = (Micros(60_000_000), 60_000_000u64);
    let mut out = [0.0; FRAME];
    for part in parts(bytes) {
        let Some((&step, opus)) = part.split_first() else {
            continue;
        };
        captured = match step {
            0 => captured.saturating_sub(1_000_000),
            255 => captured.saturating_add(1 << 40),
            step => captured + u64::from(step) * 200,
        };
        let voice = Voice {
            captured: Micros(captured),
            opus: Bytes::copy_from_slice(opus),
        };
        queue.push(voice, now);
        now = Micros(now.0 + FRAME_US);
        player.play(now, Duration::ZERO, &mut out);
        assert!(out.iter().all(|sample| sample.is_finite()), "at {now:?}");
    }
}

pub(crate) fn voice_seeds() -> Vec<Vec<u8>> {
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    let mut all = Vec::new();
    for frame in 0..12u8 {
        let spoken: [f32; FRAME] =
            std::array::from_fn(|at| (at as f32 * 0.02 * f32::from(frame % 4)).sin() * 0.3);
        if let Ok(Some(opus)) = encoder.encode(&spoken) {
            let length = opus.len().min(254);
            all.push(u8::try_from(length + 1).unwrap_or(u8::MAX));
            all.push(100);
            all.extend(&opus[..length]);
        }
    }
    vec![all]
}
