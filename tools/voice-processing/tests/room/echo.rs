//! The echo of the loudspeaker, and a person who speaks at the same time.

use crate::speech::{active_level, level, likeness, noise, speech};
use crate::{Devices, MODERATE, part, sent_alone, sum};

const SECONDS: f64 = 16.0;
/// After this the canceller knows the room.
const SETTLED: f64 = 4.0;

/// How much less of the echo is sent than heard, dB.
fn reduced(devices: &Devices, far: &[f64], noise: &[f64]) -> f64 {
    let echo = devices.echo(far);
    let sent = devices.sent(far, &sum(&echo, noise));
    let reduced = level(part(&echo, SETTLED, SECONDS)) - level(part(&sent, SETTLED, SECONDS));
    println!(
        "{} ms, {:.0} ppm: heard at {:.1} dBFS, sent {reduced:.1} dB below",
        devices.hidden / 48,
        devices.slower * 1e6,
        level(part(&echo, SETTLED, SECONDS))
    );
    reduced
}

#[test]
fn the_echo_is_30_db_lower_whatever_delay_the_devices_hide() {
    let far = speech(SECONDS, 120.0, -20.0, 1);
    let noise = noise(SECONDS, -75.0, 2);
    for ms in [0, 30, 70, 120] {
        let devices = Devices {
            loudness: MODERATE,
            hidden: ms * 48,
            slower: 0.0,
        };
        let reduced = reduced(&devices, &far, &noise);
        assert!(reduced >= 30.0, "{ms} ms: {reduced:.1} dB");
    }
}

#[test]
fn the_echo_stays_away_where_two_clocks_differ_and_where_there_is_noise() {
    let far = speech(SECONDS, 120.0, -20.0, 1);
    for slower in [1e-4, -1e-4] {
        let devices = Devices {
            loudness: MODERATE,
            hidden: 40 * 48,
            slower,
        };
        let reduced = reduced(&devices, &far, &noise(SECONDS, -75.0, 2));
        assert!(reduced >= 30.0, "{slower}: {reduced:.1} dB");
    }
    let devices = Devices {
        loudness: MODERATE,
        hidden: 40 * 48,
        slower: 0.0,
    };
    let reduced = reduced(&devices, &far, &noise(SECONDS, -45.0, 2));
    assert!(reduced >= 20.0, "{reduced:.1} dB with noise");
}

#[test]
fn who_speaks_while_the_other_one_does_is_heard() {
    let far = speech(SECONDS, 120.0, -20.0, 1);
    let mut near = speech(SECONDS, 200.0, -20.0, 3);
    // The other one is alone at first.
    near[..8 * 48_000].fill(0.0);
    let heard = sum(&near, &noise(SECONDS, -75.0, 2));
    let alone = sent_alone(&heard);
    let alone = part(&alone, 8.0, SECONDS);
    // Echoes of 7 dB below the person who speaks, 13 and 19.
    for (loudness, least) in [(0.25, 0.6), (0.125, 0.7), (0.0625, 0.7)] {
        let devices = Devices {
            loudness,
            hidden: 40 * 48,
            slower: 0.0,
        };
        let echo = devices.echo(&far);
        let both = devices.sent(&far, &sum(&heard, &echo));
        let both = part(&both, 8.0, SECONDS);
        let lower = active_level(alone) - active_level(both);
        let alike = likeness(alone, both);
        let of_echo = likeness(part(&echo, 8.0, SECONDS), both);
        println!(
            "echo of {:.1} dBFS: {lower:.1} dB lower than without the other one, likeness {alike:.3}, to the echo {of_echo:.3}",
            active_level(part(&echo, 8.0, SECONDS))
        );
        assert!(lower.abs() < 3.0, "{lower:.1} dB lower");
        assert!(alike > least, "{alike:.3} alike");
        assert!(of_echo < 0.2, "the echo is in it: {of_echo:.3}");
    }
}
