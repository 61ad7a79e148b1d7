//! Noise, and the level of a voice.

use crate::acoustics::RATE;
use crate::speech::{Random, active_level, level, noise, speech};
use crate::{Devices, MODERATE, part, sent_alone, sum};
use std::time::{Duration, Instant};
use voice_processing::{DELAY, FRAME, FarEnd, PIECE, VoiceProcessor};

#[test]
fn noise_becomes_less_and_speech_does_not() {
    let seconds = 20.0;
    let mut voice = speech(seconds, 130.0, -22.0, 4);
    voice[..8 * 48_000].fill(0.0);
    let noise = noise(seconds, -45.0, 5);
    let sent = sent_alone(&sum(&voice, &noise));
    let less = level(part(&noise, 4.0, 8.0)) - level(part(&sent, 4.0, 8.0));
    let (before, after) = (
        active_level(part(&voice, 10.0, 20.0)),
        active_level(part(&sent, 10.0, 20.0)),
    );
    println!("noise {less:.1} dB less, speech of {before:.1} dBFS is sent at {after:.1}");
    assert!(less >= 10.0, "{less:.1} dB less");
    assert!(
        (after - before).abs() < 4.0,
        "{before:.1} became {after:.1} dBFS"
    );
}

#[test]
fn a_low_voice_and_a_loud_one_are_sent_at_about_the_same_level_and_none_is_clipped() {
    let mut levels = Vec::new();
    for dbfs in [-45.0, -30.0, -20.0, -8.0] {
        let voice = speech(30.0, 130.0, dbfs, 6);
        let sent = sent_alone(&sum(&voice, &noise(30.0, -80.0, 7)));
        let after = active_level(part(&sent, 20.0, 30.0));
        let most = sent
            .iter()
            .fold(0.0f64, |most, sample| most.max(sample.abs()));
        println!(
            "{dbfs} dBFS is sent at {after:.1}, samples of {:.1} dBFS at most",
            20.0 * most.log10()
        );
        assert!(most <= 0.8913, "{dbfs} dBFS: {most} is above -1 dBFS");
        levels.push(after);
    }
    for after in levels {
        assert!((-26.0..=-12.0).contains(&after), "{after:.1} dBFS");
    }
}

#[test]
fn a_quiet_room_stays_quiet() {
    let mut heard = noise(40.0, -60.0, 8);
    let voice = speech(10.0, 130.0, -35.0, 6);
    for (heard, voice) in heard.iter_mut().zip(voice) {
        *heard += voice;
    }
    let sent = sent_alone(&heard);
    let soon = level(part(&sent, 12.0, 14.0));
    let late = level(part(&sent, 36.0, 39.0));
    println!("silence after speech is sent at {soon:.1} dBFS, half a minute later at {late:.1}");
    assert!(late < -50.0, "{late:.1} dBFS");
    assert!(
        (late - soon).abs() < 6.0,
        "the gain went from {soon:.1} to {late:.1} in silence"
    );
}

#[test]
fn the_voice_is_late_by_as_much_as_is_said() {
    let voice = speech(6.0, 130.0, -20.0, 4);
    let devices = Devices {
        loudness: MODERATE,
        hidden: 0,
        slower: 0.0,
    };
    let silence = vec![0.0; voice.len()];
    // With an echo canceller and without one. Both are without the delay that is said, which is taken away again.
    for sent in [devices.sent(&silence, &voice), sent_alone(&voice)] {
        // Less than a period of the voice either way.
        let (lag, _) = (-160i32..=160)
            .map(|lag| {
                let begin = (3.0 * RATE) as i32;
                let alike: f64 = (begin..begin + 48_000)
                    .map(|n| voice[n as usize] * sent[(n + lag) as usize])
                    .sum();
                (lag, alike)
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("lags");
        println!("{:.2} ms later than {DELAY:?}", f64::from(lag) / 48.0);
        assert!(lag.abs() <= 48, "{lag} samples");
    }
}

#[test]
fn no_sample_and_no_time_that_devices_tell_does_harm() {
    let far_end = FarEnd::default();
    let mut processor = VoiceProcessor::new(Some(&far_end));
    let zero = Instant::now() + Duration::from_secs(7200);
    let mut random = Random::new(10);
    let strange = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN_POSITIVE,
        -1.0,
    ];
    for _ in 0..500 {
        let mut any = || {
            let k = ((random.next() + 1.0) * 5.0) as usize;
            strange.get(k).copied().unwrap_or(0.1)
        };
        let piece: [f32; PIECE] = std::array::from_fn(|_| any());
        let mut frame: [f32; FRAME] = std::array::from_fn(|_| any());
        let mut at = || {
            if random.next() > 0.0 {
                zero + Duration::from_secs_f64(3600.0 * (random.next() + 1.0))
            } else {
                zero - Duration::from_secs_f64(1800.0 * (random.next() + 1.0))
            }
        };
        far_end.play(at(), &piece);
        processor.process(at(), &mut frame);
        assert!(frame.iter().all(|sample| sample.abs() <= 0.9), "{frame:?}");
    }
    // And it works again afterwards.
    let voice = speech(8.0, 130.0, -20.0, 4);
    let mut sent = Vec::new();
    for frame in voice.as_chunks::<FRAME>().0 {
        let mut frame = frame.map(|sample| sample as f32);
        processor.process(zero, &mut frame);
        sent.extend(frame.map(f64::from));
    }
    let after = active_level(part(&sent, 5.0, 8.0));
    println!("sent at {after:.1} dBFS");
    assert!((-30.0..-10.0).contains(&after), "{after:.1} dBFS");
}
