//! What a microphone and a loudspeaker have in common: a stream that is opened, lost and opened again, on the one thread that uses it.

use super::SoundError;
use crate::RATE;
use ndk::audio::{
    AudioDirection, AudioError, AudioFormat, AudioInputPreset, AudioPerformanceMode,
    AudioSharingMode, AudioStream, AudioStreamBuilder, AudioUsage, Clockid,
};
use rustix::time::{ClockId, clock_gettime};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Samples that are handed over at a time: 10 ms.
pub(super) const PIECE: usize = 480;
/// Between two measurements of a device's delay.
pub(super) const MEASURING: Duration = Duration::from_secs(1);
/// A stream that does nothing for so long is of a device that is no longer there.
pub(super) const LONGEST_SILENCE: Duration = Duration::from_secs(4);
/// Between two looks whether it is to stop, nanoseconds.
pub(super) const STOPPING_NS: i64 = 100_000_000;
/// Between two looks whether a device has come back.
const LOOKING: Duration = Duration::from_millis(500);
/// The same, while it is looked whether it is to stop.
const LOOK: Duration = Duration::from_millis(50);
/// Bursts of the device that wait in its buffer: with one alone each delay of the thread is heard.
const BURSTS: i32 = 2;

/// What a device is, as it is told.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) direction: AudioDirection,
    pub(super) channels: i32,
    /// What a call does while the device is away.
    pub(super) without: &'static str,
}

/// A device's thread, which ends when this is dropped.
#[derive(Debug)]
pub(super) struct Device {
    kind: Kind,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Device {
    /// Opens it, and has `work` use each stream of it until that is lost, or the flag is set that it gets.
    ///
    /// # Errors
    /// If Android does not open it.
    pub(super) fn begin(
        kind: Kind,
        asked: Option<&str>,
        mut work: impl FnMut(&AudioStream, &AtomicBool) -> Result<(), SoundError> + Send + 'static,
    ) -> Result<Self, SoundError> {
        if let Some(name) = asked {
            return Err(SoundError::Named {
                kind: kind.name,
                name: name.to_owned(),
            });
        }
        let stop = Arc::<AtomicBool>::default();
        let (opened, outcome) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name(kind.name.to_owned())
            .spawn({
                let stop = Arc::clone(&stop);
                move || {
                    let mut stream = match open(kind) {
                        Ok(stream) => {
                            // Who waits for it is there.
                            let _ = opened.send(Ok(()));
                            stream
                        }
                        Err(error) => {
                            let _ = opened.send(Err(error));
                            return;
                        }
                    };
                    while let Err(error) = work(&stream, &stop) {
                        drop(stream);
                        log::warn!(
                            "the {} is away ({}): {} until it is back",
                            kind.name,
                            whole(&error),
                            kind.without
                        );
                        let Some(again) = find(kind, &stop) else {
                            return;
                        };
                        log::info!("the {} is back", kind.name);
                        stream = again;
                    }
                }
            })
            .map_err(SoundError::Thread)?;
        outcome.recv().unwrap_or(Err(SoundError::Failed))?;
        Ok(Self {
            kind,
            stop,
            thread: Some(thread),
        })
    }

    /// What it is called.
    pub(super) fn name(&self) -> &'static str {
        self.kind.name
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            log::error!("the thread of the {} has failed", self.kind.name);
        }
    }
}

/// Looks for the device until it is there; nothing if it is to stop before.
fn find(kind: Kind, stop: &AtomicBool) -> Option<AudioStream> {
    let mut looked = Instant::now();
    while !stop.load(Relaxed) {
        if looked.elapsed() >= LOOKING {
            looked = Instant::now();
            match open(kind) {
                Ok(stream) => return Some(stream),
                Err(error) => log::debug!("no {} yet: {}", kind.name, whole(&error)),
            }
        }
        std::thread::sleep(LOOK);
    }
    None
}

fn open(kind: Kind) -> Result<AudioStream, SoundError> {
    let closed = |source| SoundError::Closed {
        kind: kind.name,
        source,
    };
    let stream = AudioStreamBuilder::new()
        .map_err(closed)?
        .direction(kind.direction)
        .format(AudioFormat::PCM_Float)
        .sample_rate(RATE.cast_signed())
        .channel_count(kind.channels)
        .performance_mode(AudioPerformanceMode::LowLatency)
        .sharing_mode(AudioSharingMode::Shared)
        // Who is heard is a person: the system turns down what else plays, and its own echo canceller looks at this stream.
        .usage(AudioUsage::VoiceCommunication)
        .input_preset(AudioInputPreset::VoiceCommunication)
        .open_stream()
        .map_err(closed)?;
    let (channels, rate_hz) = (stream.channel_count(), stream.sample_rate());
    let is_right = channels == kind.channels
        && rate_hz == RATE.cast_signed()
        && stream.format() == AudioFormat::PCM_Float;
    if !is_right {
        return Err(SoundError::Format {
            kind: kind.name,
            channels,
            rate_hz,
        });
    }
    if kind.direction == AudioDirection::Output {
        let wanted = stream.frames_per_burst().saturating_mul(BURSTS);
        // More than asked for is as good, only later.
        let size = stream.set_buffer_size_in_frames(wanted);
        if let Err(error) = frames(size.map(i32::unsigned_abs)) {
            log::debug!("the buffer of the {} stays as it is: {error}", kind.name);
        }
    }
    stream.request_start().map_err(closed)?;
    Ok(stream)
}

/// The frames that a call has read, written or set. The crate `ndk` (0.9) takes every result but 0 for an error, also a count of frames.
///
/// # Errors
/// If it is an error.
pub(super) fn frames(result: Result<u32, AudioError>) -> Result<usize, AudioError> {
    match result {
        Ok(count) => Ok(count as usize),
        Err(error) => usize::try_from(i32::from(error)).map_err(|_| error),
    }
}

/// From now until sample `count` of `stream` is in the air, or was, which is negative, seconds; nothing where the device does not tell.
pub(super) fn in_the_air(stream: &AudioStream, count: u64) -> Option<f64> {
    let known = stream.timestamp(Clockid::Monotonic).ok()?;
    let now = clock_gettime(ClockId::Monotonic);
    let now = now.tv_sec as f64 + now.tv_nsec as f64 / 1e9;
    let ahead = (count as f64 - known.frame_position as f64) / f64::from(RATE);
    Some(known.time_nanoseconds as f64 / 1e9 + ahead - now)
}

/// An error with its causes: a line of the log is all that is told of it.
fn whole(error: &SoundError) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}
