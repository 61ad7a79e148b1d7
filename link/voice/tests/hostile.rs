//! Packets that no encoder made, through the decoder that plays a voice.

use bytes::Bytes;
use link_codec::Micros;
use link_voice::{FRAME, FRAME_US, MAX_PACKET_BYTES, Voice, VoiceEncoder, VoicePlayout};

/// Packets tried: more where attacks run in their whole length.
fn packets() -> u64 {
    match std::env::var_os("MON3TR_ATTACKS") {
        Some(extent) if extent == "whole" => 100_000,
        _ => 12_000,
    }
}

/// 20 ms that a person may have said.
fn spoken(frame: u64, random: &mut fastrand::Rng) -> [f32; FRAME] {
    let loud = if frame % 100 < 70 { 0.4 } else { 0.0 };
    let pitch = 0.01 + 0.03 * random.f32();
    std::array::from_fn(|k| loud * ((k as f32 * pitch).sin() + 0.2 * (random.f32() - 0.5)))
}

/// A packet of any mode, bandwidth and number of frames, with any bytes.
fn made_up(random: &mut fastrand::Rng) -> Vec<u8> {
    let longest = if random.bool() { 40 } else { MAX_PACKET_BYTES };
    let mut packet: Vec<u8> = (0..random.usize(1..=longest))
        .map(|_| random.u8(..))
        .collect();
    // Runs of the same byte lead range coders astray in other ways than noise does.
    if random.u8(0..4) == 0 {
        let (from, byte) = (random.usize(0..packet.len()), random.u8(..));
        packet.iter_mut().skip(from).for_each(|it| *it = byte);
    }
    // Several frames, with padding and lengths of each, and what extensions there are within it.
    if random.u8(0..3) == 0
        && let [toc, count, lengths @ ..] = &mut packet[..]
    {
        *toc |= 3;
        *count = random.u8(..) & 0b1100_0011 | 1 << random.u8(0..6);
        for length in lengths.iter_mut().take(4) {
            *length = [0, 1, 2, 20, 251, 252, 254, 255][random.usize(0..8)];
        }
    }
    packet
}

/// An encoder's packet, with some bits turned, or cut, or under another mode's name.
fn changed(packet: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut packet = packet.to_vec();
    match random.u8(0..3) {
        0 => packet.truncate(random.usize(1..=packet.len())),
        1 => packet[0] = random.u8(..),
        _ => {
            for _ in 0..random.usize(1..8) {
                let at = random.usize(0..packet.len());
                packet[at] ^= 1 << random.u8(0..8);
            }
        }
    }
    packet
}

#[test]
fn packets_that_no_encoder_made_are_played_as_finite_sound_or_refused() {
    for seed in 0..4 {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut encoder = VoiceEncoder::new().expect("an encoder");
        let mut playout = VoicePlayout::new().expect("a playout");
        let mut heard = [0.0; FRAME];
        let mut latest = vec![8];
        for number in 0..packets() / 4 {
            let now = Micros(60_000_000 + number * FRAME_US);
            if let Some(opus) = encoder
                .encode(&spoken(number, &mut random))
                .expect("encoded")
            {
                latest = opus.to_vec();
            }
            let packet = match random.u8(0..8) {
                0..3 => Some(made_up(&mut random)),
                3..6 => Some(changed(&latest, &mut random)),
                6 => Some(latest.clone()),
                // Lost: the next one's copy is asked for, if it says that it has one.
                _ => None,
            };
            if let Some(packet) = packet {
                let opus = Bytes::from(packet);
                let captured = Micros(now.0 - 20_000);
                playout.push(Voice { captured, opus }, now);
            }
            playout.play(now, None, &mut heard);
            assert!(
                heard.iter().all(|sample| sample.is_finite()),
                "{seed} {number}"
            );
        }
        let counts = playout.statistics();
        println!("seed {seed}: {counts:?}");
        assert!(counts.decoded > 500 && counts.refused > 300, "{counts:?}");
        // An honest voice is heard again at once.
        let mut loudest = 0.0f32;
        for number in 0..50 {
            let now = Micros(60_000_000 + (packets() / 4 + number) * FRAME_US);
            let frame: [f32; FRAME] = std::array::from_fn(|k| (k as f32 * 0.03).sin() * 0.4);
            let opus = encoder.encode(&frame).expect("encoded").expect("a packet");
            let captured = Micros(now.0 - 20_000);
            playout.push(Voice { captured, opus }, now);
            playout.play(now, None, &mut heard);
            loudest = heard.iter().fold(loudest, |most, it| most.max(it.abs()));
        }
        assert!(loudest > 0.1, "seed {seed}: {loudest}");
    }
}
