//! What recording and playing have in common: the format, and how long a device may be silent.

use crate::RATE;
use pulseaudio::protocol::{SampleFormat, SampleSpec};
use std::time::Duration;

/// Bytes of a sample.
pub(crate) const SAMPLE_BYTES: u32 = 4;
/// Samples of a channel that are handed over at a time: 10 ms.
pub(crate) const PIECE: usize = 480;
/// Between two measurements of a device's delay.
pub(crate) const MEASURING: Duration = Duration::from_secs(1);
/// A stream that does nothing for so long is of a device that is no longer there; PulseAudio's null sink takes two seconds to begin.
pub(crate) const LONGEST_SILENCE: Duration = Duration::from_secs(4);

/// So many channels of 48 kHz.
pub(crate) fn format(channels: u8) -> SampleSpec {
    SampleSpec {
        format: SampleFormat::Float32Le,
        channels,
        sample_rate: RATE,
    }
}

/// Moments of bytes at an offset in a stream, of which each moment takes `frame`.
pub(crate) fn samples(offset: i64, frame: u32) -> u64 {
    u64::try_from(offset).unwrap_or(0) / u64::from(frame.max(1))
}

/// Seconds of so many bytes and, besides, so many microseconds.
pub(crate) fn seconds(bytes: i64, frame: u32, micros: u64) -> f64 {
    bytes as f64 / (f64::from(frame) * f64::from(RATE)) + micros as f64 / 1e6
}
