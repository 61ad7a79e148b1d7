//! What recording and playing have in common: the format, and how long a device may be silent.

use crate::RATE;
use pulseaudio::protocol::{SampleFormat, SampleSpec};
use std::time::Duration;

/// Bytes of a sample.
pub(crate) const SAMPLE_BYTES: u32 = 4;
/// Samples that are handed over at a time: 10 ms.
pub(crate) const PIECE: usize = 480;
/// The same in bytes.
pub(crate) const PIECE_BYTES: u32 = 480 * SAMPLE_BYTES;
/// Between two measurements of a device's delay.
pub(crate) const MEASURING: Duration = Duration::from_secs(1);
/// A stream that does nothing for so long is of a device that is no longer there; PulseAudio's null sink takes two seconds to begin.
pub(crate) const LONGEST_SILENCE: Duration = Duration::from_secs(4);

/// One channel of 48 kHz.
pub(crate) fn format() -> SampleSpec {
    SampleSpec {
        format: SampleFormat::Float32Le,
        channels: 1,
        sample_rate: RATE,
    }
}

/// Samples of bytes at an offset in a stream.
pub(crate) fn samples(offset: i64) -> u64 {
    u64::try_from(offset).unwrap_or(0) / u64::from(SAMPLE_BYTES)
}

/// Seconds of so many bytes and, besides, so many microseconds.
pub(crate) fn seconds(bytes: i64, micros: u64) -> f64 {
    bytes as f64 / f64::from(SAMPLE_BYTES * RATE) + micros as f64 / 1e6
}
