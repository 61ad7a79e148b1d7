//! RTP's time stamps: the capture time by the sender's clock, in samples of 48 kHz, of which 32 bits travel. They go around once in 24.8
//! hours, so a time near by tells which round is meant. Voice and motion then have one clock, and lips stay with what they say.

use crate::RATE;
use link_codec::Micros;

/// Of a capture time by the sender's clock.
#[must_use]
pub fn from_time(captured: Micros) -> u32 {
    low_bits(i128::from(captured.0) * i128::from(RATE) / 1_000_000)
}

/// The capture time by the sender's clock that is nearest to `near`, exact to a sample (21 us).
#[must_use]
pub fn to_time(timestamp: u32, near: Micros) -> Micros {
    let near = i128::from(near.0) * i128::from(RATE) / 1_000_000;
    let away = timestamp.wrapping_sub(low_bits(near)).cast_signed();
    let samples = (near + i128::from(away)).max(0);
    let micros = (samples * 1_000_000).div_euclid(i128::from(RATE));
    Micros(u64::try_from(micros).unwrap_or(u64::MAX))
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the rest is the round"
)]
fn low_bits(samples: i128) -> u32 {
    samples as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_come_back_around_every_round() {
        let round_us = (1u64 << 32) * 1_000_000 / u64::from(RATE);
        for base in [0, 1_764_000_000_000_000, round_us - 5, 3 * round_us + 7] {
            for step in [0u64, 1, 20_000, 999_999] {
                for late in [0u64, 40_000, 3_600_000_000] {
                    let captured = Micros(base + step);
                    let back = to_time(from_time(captured), Micros(base + step + late));
                    let off = captured.0.abs_diff(back.0);
                    assert!(off <= 22, "{base} + {step}, {late} late: {off} us off");
                }
            }
        }
    }

    #[test]
    fn frames_are_a_frame_apart() {
        // Of a sender that counts frames from any time on.
        for base in [0u64, 1_764_000_123_456_789] {
            for frame in 0..100 {
                let [one, next] = [frame, frame + 1].map(|k| from_time(Micros(base + k * 20_000)));
                assert_eq!(next.wrapping_sub(one), 960, "frame {frame}");
            }
        }
    }
}
