//! A voice from a file, said as if it were spoken now.

use crate::SendError;
use link_call::Sender;
use link_playout::Clock;
use link_voice::{FRAME, FRAME_US, Pace, RATE, Voice, VoiceEncoder};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// A WAV file of speech, again and again.
pub struct VoiceFile {
    path: PathBuf,
    wav: hound::WavReader<BufReader<File>>,
    encoder: VoiceEncoder,
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
            encoder: VoiceEncoder::new()?,
        })
    }

    /// Says it to every viewer until `stop` is set, each 20 ms when they would have been spoken. Blocks: it has a thread of its own.
    ///
    /// # Errors
    /// If the file cannot be read any longer.
    pub fn say(&mut self, host: &Sender, clock: Clock, stop: &AtomicBool) -> Result<(), SendError> {
        let piece = Duration::from_micros(FRAME_US);
        let mut pace = Pace::begin(Instant::now(), piece);
        let mut frame = [0.0; FRAME];
        while !stop.load(Relaxed) {
            self.read(&mut frame)
                .map_err(|source| SendError::VoiceFile {
                    path: self.path.clone(),
                    source,
                })?;
            let spoken = pace.next(Instant::now());
            // It is known when its last sample is.
            let known = spoken + piece;
            std::thread::sleep(known.saturating_duration_since(Instant::now()));
            if let Some(opus) = self.encoder.encode(&frame)? {
                let captured = self.encoder.captured(clock.at(spoken));
                host.say(Voice { captured, opus });
            }
        }
        Ok(())
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
