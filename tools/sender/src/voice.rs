//! Sources of voice: a file, said as if it were spoken now, and a microphone.

use crate::SendError;
use crate::mute::Mute;
use link_call::Sender;
use link_playout::Clock;
use link_voice::{FRAME, FRAME_US, Pace, RATE, Voice, VoiceEncoder};
use sound_devices::Microphone;
use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use voice_processing::VoiceProcessor;

/// A microphone is waited for no longer at a time: between two waits is looked whether it is time to stop.
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// A source of voice that sets the pace.
pub trait VoiceSource: Send {
    /// Forgets what was said before now: no one was there to hear it.
    fn begin(&mut self) {}

    /// Waits for the next 20 ms, a tenth of a second at most; when their first sample was spoken. `None` if there are none.
    ///
    /// # Errors
    /// If the source fails for good.
    fn next(&mut self, frame: &mut [f32; FRAME]) -> Result<Option<Instant>, SendError>;
}

/// Says to every viewer what comes from `source`, until `stop` is set. Blocks: a voice has a thread of its own. A panic in it is told, and
/// the call goes on in silence.
///
/// # Errors
/// If the source fails, or it cannot be encoded.
pub fn say(
    source: &mut dyn VoiceSource,
    host: &Sender,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), SendError> {
    or_silence(|| speak(source, host, clock, stop))
}

/// Ends as `voice` does; of a panic it only tells.
fn or_silence(voice: impl FnOnce() -> Result<(), SendError>) -> Result<(), SendError> {
    // Nothing that the closure refers to is used after a panic but counts and queues, which stay valid.
    catch_unwind(AssertUnwindSafe(voice)).unwrap_or_else(|_| {
        log::error!(
            "the voice has failed, which is a defect of this program: the call goes on in silence"
        );
        Ok(())
    })
}

fn speak(
    source: &mut dyn VoiceSource,
    host: &Sender,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), SendError> {
    let mut encoder = VoiceEncoder::new()?;
    let (privacy, mut mute) = (host.privacy(), Mute::default());
    let mut frame = [0.0; FRAME];
    source.begin();
    while !stop.load(Relaxed) {
        let Some(spoken) = source.next(&mut frame)? else {
            continue;
        };
        mute.apply(privacy.state().muted, &mut frame);
        encoder.set_copies(host.wants_copies())?;
        if let Some(opus) = encoder.encode(&frame)? {
            let captured = encoder.captured(clock.at(spoken));
            host.say(Voice { captured, opus });
        }
    }
    Ok(())
}

/// A microphone, without echo and noise and at an even level.
#[derive(Debug)]
pub struct ProcessedMicrophone {
    microphone: Microphone,
    processor: VoiceProcessor,
}

impl ProcessedMicrophone {
    /// What `microphone` hears, by way of `processor`.
    #[must_use]
    pub fn new(microphone: Microphone, processor: VoiceProcessor) -> Self {
        Self {
            microphone,
            processor,
        }
    }
}

impl VoiceSource for ProcessedMicrophone {
    fn begin(&mut self) {
        self.microphone.skip();
    }

    fn next(&mut self, frame: &mut [f32; FRAME]) -> Result<Option<Instant>, SendError> {
        let heard = self.microphone.next(frame, LONGEST_WAIT);
        Ok(heard.map(|heard| {
            self.processor.process(heard, frame);
            heard.checked_sub(voice_processing::DELAY).unwrap_or(heard)
        }))
    }
}

const _: () = assert!(
    RATE == voice_processing::RATE && FRAME == voice_processing::FRAME,
    "voice is processed as it is encoded"
);
const _: () = assert!(
    RATE == sound_devices::RATE,
    "a microphone's rate is voice's"
);

/// A WAV file of speech, again and again.
pub struct VoiceFile {
    path: PathBuf,
    wav: hound::WavReader<BufReader<File>>,
    pace: Option<Pace>,
}

impl std::fmt::Debug for VoiceFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoiceFile")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl VoiceFile {
    /// Opens a file of 48 kHz with one or two channels.
    ///
    /// # Errors
    /// If it cannot be read, or is none.
    pub fn open(path: &Path) -> Result<Self, SendError> {
        let broken = |source| SendError::VoiceFile {
            path: path.to_owned(),
            source,
        };
        let wav = hound::WavReader::open(path).map_err(broken)?;
        let spec = wav.spec();
        let fits = spec.sample_rate == RATE && matches!(spec.channels, 1 | 2);
        if !fits || wav.duration() == 0 {
            return Err(SendError::VoiceFormat {
                path: path.to_owned(),
                samples: wav.duration(),
                rate_hz: spec.sample_rate,
                channels: spec.channels,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            wav,
            pace: None,
        })
    }

    /// The next frame; from the start again after the end.
    fn read(&mut self, frame: &mut [f32; FRAME]) -> Result<(), hound::Error> {
        let is_stereo = self.wav.spec().channels == 2;
        for slot in frame {
            let mut sample = next(&mut self.wav)?;
            if sample.is_none() {
                self.wav.seek(0)?;
                sample = next(&mut self.wav)?;
            }
            let sample = sample.unwrap_or_default();
            *slot = if is_stereo {
                f32::midpoint(sample, next(&mut self.wav)?.unwrap_or(sample))
            } else {
                sample
            };
        }
        Ok(())
    }
}

impl VoiceSource for VoiceFile {
    fn next(&mut self, frame: &mut [f32; FRAME]) -> Result<Option<Instant>, SendError> {
        let piece = Duration::from_micros(FRAME_US);
        self.read(frame).map_err(|source| SendError::VoiceFile {
            path: self.path.clone(),
            source,
        })?;
        let now = Instant::now();
        let pace = self.pace.get_or_insert_with(|| Pace::begin(now, piece));
        let spoken = pace.next(now);
        // It is known when its last sample is.
        let known = spoken + piece;
        std::thread::sleep(known.saturating_duration_since(now));
        Ok(Some(spoken))
    }
}

/// The next sample from -1 to 1, whatever its kind; nothing at the end.
fn next(wav: &mut hound::WavReader<BufReader<File>>) -> Result<Option<f32>, hound::Error> {
    let spec = wav.spec();
    let sample = match spec.sample_format {
        hound::SampleFormat::Float => wav.samples::<f32>().next(),
        hound::SampleFormat::Int => {
            let full = 2.0f32.powi(i32::from(spec.bits_per_sample) - 1);
            let sample = wav.samples::<i32>().next();
            sample.map(|sample| sample.map(|sample| sample as f32 / full))
        }
    };
    Ok(sample.transpose()?.map(|sample| {
        if sample.is_finite() {
            sample.clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voice_that_panics_ends_in_silence_and_one_that_fails_says_why() {
        assert!(or_silence(|| panic!("a defect, for this test")).is_ok());
        let path = Path::new("no such voice.wav");
        let failed = or_silence(|| VoiceFile::open(path).map(drop));
        assert!(
            matches!(failed, Err(SendError::VoiceFile { .. })),
            "{failed:?}"
        );
        assert!(or_silence(|| Ok(())).is_ok());
    }
}
