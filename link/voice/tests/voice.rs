//! A voice over networks that delay, reorder and lose its packets, in simulated time: what is heard is what was said, when it is due.

use bytes::Bytes;
use link_codec::Micros;
use link_voice::{
    FRAME, FRAME_US, RATE, Voice, VoiceEncoder, VoicePlayout, VoiceQueue, VoiceStatistics,
};
use std::f32::consts::TAU;
use std::time::Duration;

/// The way without jitter, microseconds.
const WAY: u64 = 30_000;
/// A sound card asks for so many samples at a time: 10 ms.
const ASKED: usize = FRAME / 2;
const ASKED_US: u64 = FRAME_US / 2;
/// Bytes of a packet beside its payload: IPv4, UDP, RTP, and the tag of SRTP.
const HEADERS: usize = 20 + 8 + 12 + 10;

/// Syllables of a fifth of a second, of different pitch and vowel, with pauses between words: as even as no person speaks, but with the
/// envelope and the periods of speech.
fn speech(seconds: usize) -> Vec<f32> {
    let syllable_samples = RATE as usize / 5;
    let mut phase = 0.0f32;
    let mut low_passed = 0.0f32;
    let mut random = fastrand::Rng::with_seed(7);
    (0..seconds * RATE as usize)
        .map(|k| {
            let word_ends = (k / syllable_samples).is_multiple_of(4);
            let syllable = (k / syllable_samples) as f32;
            let within = (k % syllable_samples) as f32 / syllable_samples as f32;
            let pitch = 105.0 + 25.0 * (syllable * 1.7).sin() + 10.0 * within;
            phase = (phase + pitch / RATE as f32).fract();
            let formant = 450.0 + 300.0 * (syllable * 2.3).sin().abs();
            let pulse = (-phase * 6.0).exp() * (TAU * formant * phase / pitch).sin();
            low_passed += 0.3 * (random.f32() - 0.5 - low_passed);
            let loud = if word_ends {
                0.0
            } else {
                (within * std::f32::consts::PI).sin().powf(0.7)
            };
            0.5 * loud * (pulse + 0.05 * low_passed)
        })
        .collect()
}

/// What a network does to the packet of a frame.
type Fate<'a> = &'a mut dyn FnMut(usize) -> Option<u64>;

/// Says `spoken` over a network: when the packet of a frame arrives after it was captured, microseconds, or that it is lost. Returns what
/// is heard from the moment of the first capture on, the counts, and the bytes sent.
fn over(spoken: &[f32], at_least: Option<i64>, fate: Fate) -> (Vec<f32>, VoiceStatistics, usize) {
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    let mut playout = VoicePlayout::new().expect("a decoder");
    // Neither clock begins at zero, nor do they agree.
    let (theirs, ours) = (1_700_000_000_000_000u64, 5_000_000u64);
    let mut bytes = 0;
    let mut under_way: Vec<(u64, Voice)> = Vec::new();
    let (frames, _) = spoken.as_chunks::<FRAME>();
    for (number, frame) in frames.iter().enumerate() {
        let at = number as u64 * FRAME_US;
        let Some(opus) = encoder.encode(frame).expect("a packet") else {
            continue;
        };
        bytes += opus.len() + HEADERS;
        if let Some(took) = fate(number) {
            let captured = encoder.captured(Micros(theirs + at));
            under_way.push((at + took, Voice { captured, opus }));
        }
    }
    under_way.sort_by_key(|(arrives, _)| *arrives);
    let mut under_way = under_way.into_iter().peekable();
    let at_least = at_least.map(|after| after + (ours as i64 - theirs as i64));
    let mut heard = Vec::new();
    let mut counts = VoiceStatistics::default();
    for number in 0..(frames.len() + 25) * 2 {
        let now = number as u64 * ASKED_US;
        while let Some((arrives, voice)) = under_way.next_if(|(arrives, _)| *arrives <= now) {
            playout.push(voice, Micros(ours + arrives));
        }
        let mut out = [0.0; ASKED];
        playout.play(Micros(ours + now), at_least, &mut out);
        assert!(
            out.iter().all(|sample| sample.abs() <= 1.5),
            "frame {number}: {out:?}"
        );
        heard.extend_from_slice(&out);
        // What is made up after the last packet is no loss.
        if number < frames.len() * 2 {
            counts = playout.statistics();
        }
    }
    (heard, counts, bytes)
}

/// Loudness every 5 ms, of 20 ms each.
fn envelope(samples: &[f32]) -> Vec<f32> {
    (samples.windows(FRAME).step_by(240))
        .map(|piece| (piece.iter().map(|s| s * s).sum::<f32>() / FRAME as f32).sqrt())
        .collect()
}

/// How much later `heard` is than `spoken`, milliseconds, and how alike their envelopes are then.
fn compared(spoken: &[f32], heard: &[f32]) -> (f32, f32) {
    let (spoken, heard) = (envelope(spoken), envelope(heard));
    let like = |late: usize| {
        let pairs = || spoken.iter().zip(heard.iter().skip(late));
        let count = pairs().count().max(1) as f32;
        let mean = |of: &dyn Fn((&f32, &f32)) -> f32| pairs().map(of).sum::<f32>() / count;
        let (a, b) = (mean(&|(a, _)| *a), mean(&|(_, b)| *b));
        let cross = mean(&|(x, y)| (x - a) * (y - b));
        cross / (mean(&|(x, _)| (x - a).powi(2)) * mean(&|(_, y)| (y - b).powi(2))).sqrt()
    };
    let best = (0..80)
        .max_by(|a, b| like(*a).total_cmp(&like(*b)))
        .expect("some lag");
    (best as f32 * 5.0, like(best))
}

#[test]
fn on_a_good_network_all_is_heard_as_it_was_said() {
    let spoken = speech(10);
    let (heard, counts, bytes) = over(&spoken, None, &mut |_| Some(WAY));
    let (late, alike) = compared(&spoken, &heard);
    println!(
        "{late} ms late, {alike} alike, {} kbit/s, {counts:?}",
        bytes * 8 / 10_000
    );
    assert_eq!(
        (counts.concealed, counts.recovered, counts.late),
        (0, 0, 0),
        "{counts:?}"
    );
    assert!(alike > 0.97, "{alike} alike");
    // The way, and what is asked for at a time.
    assert!(
        (WAY as f32 / 1e3..=WAY as f32 / 1e3 + 20.0).contains(&late),
        "{late} ms late"
    );
    assert!(
        bytes * 8 / 10 <= 55_000,
        "{} bit/s with all headers",
        bytes * 8 / 10
    );
}

#[test]
fn losses_are_recovered_or_concealed() {
    let spoken = speech(30);
    let mut random = fastrand::Rng::with_seed(3);
    let mut lossy = |_| {
        let jitter = random.u64(0..25_000);
        (random.f32() >= 0.05).then_some(WAY + jitter)
    };
    let (heard, counts, _) = over(&spoken, None, &mut lossy);
    let (late, alike) = compared(&spoken, &heard);
    println!("{late} ms late, {alike} alike, {counts:?}");
    assert!(
        counts.recovered > counts.concealed,
        "copies are used: {counts:?}"
    );
    assert!(
        counts.longest_gap <= 3,
        "a gap of {} frames",
        counts.longest_gap
    );
    assert!(alike > 0.9, "{alike} alike");
    assert!(
        (WAY as f32 / 1e3..=WAY as f32 / 1e3 + 50.0).contains(&late),
        "{late} ms late"
    );
}

#[test]
fn it_waits_for_motion() {
    let spoken = speech(10);
    for after in [80_000, 140_000] {
        let (heard, counts, _) = over(&spoken, Some(after), &mut |_| Some(WAY));
        let (late, alike) = compared(&spoken, &heard);
        let wanted = after as f32 / 1e3;
        println!("{late} ms late of {wanted}, {alike} alike");
        // To the pieces of the envelopes.
        assert!((late - wanted).abs() <= 5.0, "{late} ms late of {wanted}");
        assert!(
            alike > 0.97 && counts.concealed == 0,
            "{alike} alike, {counts:?}"
        );
    }
}

#[test]
fn a_path_that_becomes_longer_and_shorter_is_followed_without_a_gap() {
    let spoken = speech(40);
    // The delay falls slowly: a path that was bad may be so again.
    let mut way = |number: usize| {
        Some(
            WAY + if (500..1_000).contains(&number) {
                70_000
            } else {
                0
            },
        )
    };
    let (heard, counts, _) = over(&spoken, None, &mut way);
    println!("{counts:?}");
    assert!(counts.lengthened > 0 && counts.shortened > 0, "{counts:?}");
    assert_eq!(counts.jumps, 0, "{counts:?}");
    // The packets of the first moment after the change cannot be there in time.
    assert!(counts.concealed <= 10, "{counts:?}");
    let quarter = |number: usize| {
        let of = |all: &[f32]| all[number * 480_000 + 240_000..(number + 1) * 480_000].to_vec();
        compared(&of(&spoken), &of(&heard))
    };
    let lates = [0, 1, 3].map(|number| quarter(number).0);
    assert!(
        lates[1] >= lates[0] + 60.0 && lates[2] <= lates[0] + 20.0,
        "{lates:?} ms late"
    );
}

#[test]
fn a_queue_hands_over_what_was_said_and_knows_when_it_was_heard() {
    let queue = VoiceQueue::default();
    let at = |ms: u64| Micros(1_000_000 + ms * 1_000);
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    let spoken = speech(2);
    let (frames, _) = spoken.as_chunks::<FRAME>();
    let mut packets = Vec::new();
    for (number, frame) in frames.iter().enumerate() {
        let captured = at(number as u64 * 20);
        packets.extend(
            (encoder.encode(frame).expect("a packet")).map(|opus| Voice { captured, opus }),
        );
    }
    queue.push(packets[0].clone(), at(30));
    assert!(
        queue.statistics().is_none() && queue.is_played(),
        "no one listens"
    );
    let mut player = queue.listen().expect("a player");
    // Motion is shown 100 ms after its capture.
    queue.follow(Some(100_000));
    let mut out = [0.0; ASKED];
    let (mut first_heard, mut under_way) = (None, packets[20..60].iter().peekable());
    let loudest = |out: &[f32]| {
        out.iter()
            .fold(0.0f32, |most, sample| most.max(sample.abs()))
    };
    for ms in (400..).step_by(10) {
        while let Some(voice) = under_way.next_if(|voice| voice.captured.0 + 30_000 <= at(ms).0) {
            queue.push(voice.clone(), at(ms));
        }
        player.play(at(ms), Duration::ZERO, &mut out);
        if loudest(&out) > 0.02 {
            first_heard.get_or_insert(ms);
        }
        if under_way.peek().is_none() {
            break;
        }
        assert!(
            !queue.is_played() || ms < 430,
            "after {ms} ms something waits"
        );
    }
    assert!(
        first_heard.is_some_and(|ms| (500..540).contains(&ms)),
        "{first_heard:?}"
    );
    // The last of them was captured 30 ms ago: 70 ms are still to be heard.
    assert!(!queue.is_played(), "something waits");
    for ms in (1_220..1_320).step_by(10) {
        player.play(at(ms), Duration::ZERO, &mut out);
    }
    assert!(queue.is_played(), "all was heard");
    let counts = queue.statistics().expect("it is played");
    assert_eq!(
        (counts.received, counts.decoded, counts.late),
        (40, 40, 0),
        "{counts:?}"
    );
    // A packet took 30 ms, and 10 ms are asked for at a time: so much is needed, and what a device needs besides.
    let device = Duration::from_millis(25);
    player.play(at(1_320), device, &mut out);
    assert_eq!(
        queue.offset_us(at(1_330)),
        Some(65_000),
        "as motion would wait for it"
    );
    assert_eq!(
        (queue.offset_us(at(2_000)), queue.heard_offset_us(at(2_000))),
        (None, None),
        "the device has been away for 680 ms: motion waits for nothing"
    );
    // More than a ring holds is dropped, and counted.
    for voice in &packets {
        queue.push(voice.clone(), at(2_000));
    }
    player.play(at(2_000), Duration::ZERO, &mut out);
    let counts = queue.statistics().expect("it is played");
    let sent = 40 + packets.len() as u64;
    assert_eq!(counts.received, sent, "{counts:?}");
    assert_eq!(counts.overflowed, packets.len() as u64 - 64, "{counts:?}");
    // Another connection has other times, which are not compared with these.
    queue.begin_connection();
    queue.follow(None);
    player.play(at(2_010), Duration::ZERO, &mut out);
    assert_eq!(
        queue.offset_us(at(2_010)),
        None,
        "a connection that brings no voice delays no motion"
    );
    assert!(queue.is_played(), "what the last one left is not played");
    let captured = Micros(77_000_000_000);
    queue.push(
        Voice {
            captured,
            ..packets[30].clone()
        },
        at(5_000),
    );
    player.play(at(5_000), Duration::ZERO, &mut out);
    let counts = queue.statistics().expect("it is played");
    assert_eq!(
        (counts.refused, counts.received),
        (0, sent + 1),
        "{counts:?}"
    );
    drop(player);
    assert!(queue.is_played(), "no one plays any longer");
}

#[test]
fn silence_costs_next_to_nothing() {
    let seconds = 30;
    let mut random = fastrand::Rng::with_seed(5);
    // Of a quiet room.
    let quiet: Vec<f32> = (0..RATE * seconds)
        .map(|_| (random.f32() - 0.5) * 2e-4)
        .collect();
    let mut sent = 0;
    let (heard, counts, bytes) = over(&quiet, None, &mut |_| {
        sent += 1;
        // One of those that tell of the silence is lost.
        (sent != 12).then_some(WAY)
    });
    println!(
        "{} bit/s in {sent} packets, {counts:?}",
        bytes * 8 / seconds as usize
    );
    assert!(
        bytes * 8 / (seconds as usize) < 2_000,
        "{} bit/s",
        bytes * 8 / seconds as usize
    );
    assert_eq!(counts.concealed, 0, "silence is not concealed: {counts:?}");
    assert!(counts.silent > 1_000, "{counts:?}");
    assert!(
        heard.iter().all(|sample| sample.abs() < 0.01),
        "and it is quiet"
    );
}

#[test]
fn the_onset_of_speech_after_a_silence_is_speech() {
    let mut random = fastrand::Rng::with_seed(9);
    let quiet = std::iter::repeat_with(|| (random.f32() - 0.5) * 2e-4);
    let onset = 3 * RATE as usize;
    // Without the pause that it begins with.
    let words = speech(3).split_off(RATE as usize / 5);
    let spoken: Vec<f32> = quiet.take(onset).chain(words).collect();
    // The network holds up all packets from one on for a moment: from the second, the third ...
    for held in onset / FRAME + 1..onset / FRAME + 5 {
        let mut held_up = |number: usize| {
            let waits = (held + 3).saturating_sub(number).min(3) as u64;
            Some(WAY + if number < held { 0 } else { waits * FRAME_US })
        };
        let (heard, counts, _) = over(&spoken, None, &mut held_up);
        let (from, to) = (held * FRAME, onset + RATE as usize);
        let (lag, alike) = compared(&spoken[from..to], &heard[from..to + RATE as usize / 5]);
        println!("{held} and later are held up: {lag} ms, {alike} alike, {counts:?}");
        // They are waited for, as in the middle of speech, and heard from the first one on.
        assert_eq!(counts.late, 0, "{counts:?}");
        assert!(counts.concealed > 0, "{counts:?}");
        assert!(alike > 0.9, "{held}: {alike} alike");
    }
}

fn noise(random: &mut fastrand::Rng, lengths: std::ops::Range<usize>) -> Vec<u8> {
    let mut bytes = vec![0; random.usize(lengths)];
    random.fill(&mut bytes);
    bytes
}

/// A packet as a network or a stranger may spoil it.
fn spoilt(packet: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = packet.to_vec();
    match random.u8(0..5) {
        0 => {}
        1 => bytes.truncate(random.usize(0..=packet.len())),
        2 => bytes.extend(noise(random, 1..2_000)),
        3 => {
            // What comes first says how the rest is read.
            let place = random.usize(0..packet.len().min(3));
            bytes[place] = random.u8(..);
        }
        _ => {
            for _ in 0..random.usize(1..8) {
                let place = random.usize(0..packet.len());
                bytes[place] ^= 1 << random.u8(0..8);
            }
        }
    }
    bytes
}

#[test]
fn packets_without_sense_are_refused_and_nothing_grows() {
    let mut playout = VoicePlayout::new().expect("a decoder");
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    let mut random = fastrand::Rng::with_seed(11);
    let mut out = [0.0; FRAME];
    let spoken = speech(10);
    let (said, _) = spoken.as_chunks::<FRAME>();
    let good: Vec<Bytes> = (said.iter())
        .filter_map(|frame| encoder.encode(frame).expect("a packet"))
        .collect();
    let mut good = good.iter().flat_map(|packet| [packet; 2]).cycle();
    for number in 0..20_000u64 {
        let good = good.next().expect("packets of speech");
        let opus: Vec<u8> = if random.u8(0..4) == 0 {
            noise(&mut random, 0..3_000)
        } else {
            spoilt(good, &mut random)
        };
        // At first only what they hold has no sense, then their times too.
        let wild = number >= 10_000;
        let captured = match random.u8(0..20) {
            0 if wild => u64::MAX,
            1 if wild => 0,
            2 if wild => random.u64(..),
            _ => number / 2 * FRAME_US + 1_000_000,
        };
        let arrived = if wild && random.u8(..) == 0 {
            random.u64(..)
        } else {
            1_000_000 + number * 10_000
        };
        playout.push(
            Voice {
                captured: Micros(captured),
                opus: Bytes::from(opus),
            },
            Micros(arrived),
        );
        if number.is_multiple_of(2) {
            let at_least = (wild && random.u8(..) == 0).then(|| random.i64(..));
            playout.play(Micros(1_000_000 + number * 10_000), at_least, &mut out);
            assert!(
                out.iter().all(|sample| sample.is_finite()),
                "packet {number}"
            );
        }
    }
    let counts = playout.statistics();
    println!("{counts:?}");
    assert!(counts.refused > 1_000 && counts.decoded > 100, "{counts:?}");
    // And a voice with sense is heard after them.
    playout.reset();
    let spoken = speech(2);
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    let (frames, _) = spoken.as_chunks::<FRAME>();
    let mut loudest = 0.0f32;
    for (number, frame) in frames.iter().enumerate() {
        let at = 1_000_000_000 + number as u64 * FRAME_US;
        if let Some(opus) = encoder.encode(frame).expect("a packet") {
            playout.push(
                Voice {
                    captured: Micros(at),
                    opus,
                },
                Micros(at + WAY),
            );
        }
        playout.play(Micros(at + WAY), None, &mut out);
        loudest = out
            .iter()
            .fold(loudest, |most, sample| most.max(sample.abs()));
    }
    assert!(loudest > 0.05, "{loudest}");
}

/// Bits a second with all headers, and how many of a hundred packets have a copy of the frame before (RFC 6716, section 4.2.3).
fn bits_and_copies(spoken: &[f32], copies: bool) -> (usize, usize) {
    let mut encoder = VoiceEncoder::new().expect("an encoder");
    encoder.set_copies(copies).expect("settings");
    let (frames, _) = spoken.as_chunks::<FRAME>();
    let packets: Vec<Bytes> = (frames.iter())
        .filter_map(|frame| encoder.encode(frame).expect("a packet"))
        .collect();
    let bytes: usize = packets.iter().map(|packet| packet.len() + HEADERS).sum();
    let copied =
        |packet: &&Bytes| packet[0] & 0x80 == 0 && packet.len() > 2 && packet[1] & 0x40 != 0;
    let copied = packets.iter().filter(copied).count();
    let seconds = spoken.len() / RATE as usize;
    (bytes * 8 / seconds, copied * 100 / packets.len())
}

#[test]
fn copies_are_left_out_where_nothing_is_lost_and_take_bits() {
    let spoken = speech(20);
    let (with, copied) = bits_and_copies(&spoken, true);
    println!("with copies {with} bit/s with all headers, {copied} % copied");
    assert!(copied > 50, "{copied} % of the packets");
    let (without, copied) = bits_and_copies(&spoken, false);
    println!("without {without} bit/s, {copied} % copied");
    assert_eq!(copied, 0, "percent of the packets");
    assert!(without < with, "{without} and {with} bit/s");
}
