//! The loudspeaker.

use super::device::{
    Device, Kind, LONGEST_SILENCE, MEASURING, PIECE, STOPPING_NS, frames, in_the_air,
};
use super::{SoundError, SoundServer};
use crate::Fill;
use crate::clock::DeviceClock;
use ndk::audio::{AudioDirection, AudioStream};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

const KIND: Kind = Kind {
    name: "loudspeaker",
    direction: AudioDirection::Output,
    channels: 2,
    without: "the call goes on unheard",
};

/// A loudspeaker that plays while this is there, again after it was away.
#[derive(Debug)]
pub struct Loudspeaker(Device);

impl Loudspeaker {
    /// Plays what `fill` makes on the loudspeaker that Android chooses: the headset's own, or headphones.
    ///
    /// # Errors
    /// If Android does not open it, or one is asked for by name.
    pub fn begin(
        _server: &SoundServer,
        name: Option<&str>,
        mut fill: Fill,
    ) -> Result<Self, SoundError> {
        let device = Device::begin(KIND, name, move |stream, stop| {
            play(stream, &mut fill, stop)
        })?;
        Ok(Self(device))
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        self.0.name()
    }
}

/// Plays until it is to stop.
fn play(stream: &AudioStream, fill: &mut Fill, stop: &AtomicBool) -> Result<(), SoundError> {
    let mut clock = DeviceClock::new();
    let mut count = 0u64;
    let mut measured = Instant::now();
    let mut piece = [[0.0f32; 2]; PIECE];
    clock.observe(0, measured);
    while !stop.load(Relaxed) {
        fill(clock.at(count), clock.delay(), &mut piece);
        if !write(stream, &piece, stop)? {
            return Ok(());
        }
        count += PIECE as u64;
        let now = Instant::now();
        // There is room for the next piece once this one is written.
        clock.observe(count, now);
        if now > measured + MEASURING {
            measured = now;
            if let Some(after) = in_the_air(stream, count) {
                clock.will_be_in_the_air(count, Instant::now(), after);
            }
        }
    }
    Ok(())
}

/// Waits until there is room for all of `samples`; whether there was, before it was to stop.
fn write(
    stream: &AudioStream,
    samples: &[[f32; 2]],
    stop: &AtomicBool,
) -> Result<bool, SoundError> {
    let mut rest = samples;
    let mut last = Instant::now();
    while !rest.is_empty() {
        if stop.load(Relaxed) {
            return Ok(false);
        }
        let length = i32::try_from(rest.len()).unwrap_or(i32::MAX);
        // SAFETY: the stream has two channels of 32-bit floats (`open` has looked), so `length` frames are what `rest` has.
        let written = unsafe { stream.write(rest.as_ptr().cast(), length, STOPPING_NS) };
        let written = frames(written).map_err(SoundError::TakenAway)?;
        if written > 0 {
            last = Instant::now();
        } else if last.elapsed() > LONGEST_SILENCE {
            return Err(SoundError::Slow);
        }
        rest = rest.get(written..).unwrap_or_default();
    }
    Ok(true)
}
