//! The microphone.

use super::device::{
    Device, Kind, LONGEST_SILENCE, MEASURING, PIECE, STOPPING_NS, frames, in_the_air,
};
use super::{SoundError, SoundServer};
use crate::clock::DeviceClock;
use crate::heard::Heard;
use ndk::audio::{AudioDirection, AudioStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

const KIND: Kind = Kind {
    name: "microphone",
    direction: AudioDirection::Input,
    channels: 1,
    without: "the call goes on without it",
};

/// A microphone that is heard while this is there, again after it was away.
#[derive(Debug)]
pub struct Microphone {
    device: Device,
    heard: Arc<Heard>,
}

impl Microphone {
    /// The one that Android chooses. The app must have been allowed to record.
    ///
    /// # Errors
    /// If Android does not open it, or one is asked for by name.
    pub fn open(_server: &SoundServer, name: Option<&str>) -> Result<Self, SoundError> {
        let heard = Arc::<Heard>::default();
        let device = Device::begin(KIND, name, {
            let heard = Arc::clone(&heard);
            move |stream, stop| record(stream, &heard, stop)
        })?;
        Ok(Self { device, heard })
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        self.device.name()
    }

    /// Forgets what was said up to now.
    pub fn skip(&mut self) {
        self.heard.clear();
    }

    /// Waits for as many samples as `out` takes, at most a second's, for `longest` at most; when the first of them was in the air. `None` if
    /// there are none, also while the microphone is away: it is taken up again when it is back.
    pub fn next(&mut self, out: &mut [f32], longest: Duration) -> Option<Instant> {
        self.heard.take(out, longest)
    }
}

/// Records until it is to stop.
fn record(stream: &AudioStream, heard: &Heard, stop: &AtomicBool) -> Result<(), SoundError> {
    let mut clock = DeviceClock::new();
    let mut count = 0u64;
    let (mut last, mut measured) = (Instant::now(), Instant::now());
    let mut piece = [0.0f32; PIECE];
    // A loss empties what waits: it would be taken for the sound of another time.
    heard.clear();
    while !stop.load(Relaxed) {
        let room = i32::try_from(piece.len()).unwrap_or(i32::MAX);
        // SAFETY: the stream has one channel of 32-bit floats (`open` has looked), so `room` frames are as many as `piece` has room for.
        let read = unsafe { stream.read(piece.as_mut_ptr().cast(), room, STOPPING_NS) };
        let read = frames(read).map_err(SoundError::TakenAway)?;
        let now = Instant::now();
        let Some(samples) = piece.get(..read).filter(|samples| !samples.is_empty()) else {
            if now > last + LONGEST_SILENCE {
                return Err(SoundError::Slow);
            }
            continue;
        };
        last = now;
        count += samples.len() as u64;
        clock.observe(count, now);
        if now > measured + MEASURING {
            measured = now;
            if let Some(after) = in_the_air(stream, count) {
                clock.was_in_the_air(count, Instant::now(), -after);
            }
        }
        let handed = clock.at(count);
        heard.put(samples, handed.checked_sub(clock.delay()).unwrap_or(handed));
    }
    Ok(())
}
