//! A voice from a file, said as if it were spoken now.

use crate::SendError;
use link_call::Sender;
use link_playout::Clock;
use link_voice::{FRAME, FRAME_US, RATE, Voice, VoiceEncoder};
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
        let wav = hound::WavReader::open(path)
            .map_err(|source| SendError::voice(path, source.to_string()))?;
        let spec = wav.spec();
        let fits = spec.sample_rate == RATE && matches!(spec.channels, 1 | 2);
        if !fits || wav.duration() == 0 {
            return Err(SendError::voice(
                path,
                format!(
                    "it has {} samples of {} Hz in {} channels, and voice has {RATE} Hz and one channel or two: \
                     ffmpeg -i FILE -ar {RATE} -ac 1 voice.wav makes it so",
                    wav.duration(),
                    spec.sample_rate,
                    spec.channels
                ),
            ));
        }
        Ok(Self {
            path: path.to_owned(),
            wav,
            encoder: VoiceEncoder::new()
                .map_err(|source| SendError::voice(path, source.to_string()))?,
        })
    }

    /// Says it to every viewer until `stop` is set, each 20 ms when they would have been spoken. Blocks: it has a thread of its own.
    ///
    /// # Errors
    /// If the file cannot be read any longer.
    pub fn say(&mut self, host: &Sender, clock: Clock, stop: &AtomicBool) -> Result<(), SendError> {
        let begun = Instant::now();
        let mut frame = [0.0; FRAME];
        let mut number = 0u64;
        while !stop.load(Relaxed) {
            self.read(&mut frame)?;
            let spoken = begun + Duration::from_micros(number * FRAME_US);
            number += 1;
            // It is known when its last sample is.
            let known = begun + Duration::from_micros(number * FRAME_US);
            std::thread::sleep(known.saturating_duration_since(Instant::now()));
            let opus = self.encoder.encode(&frame);
            let opus = opus.map_err(|source| SendError::voice(&self.path, source.to_string()))?;
            if let Some(opus) = opus {
                let captured = self.encoder.captured(clock.at(spoken));
                host.say(Voice { captured, opus });
            }
        }
        Ok(())
    }

    /// The next frame; from the start again after the end.
    fn read(&mut self, frame: &mut [f32; FRAME]) -> Result<(), SendError> {
        let failed = |path: &Path, why: String| SendError::voice(path, why);
        let channels = usize::from(self.wav.spec().channels);
        let mut filled = 0;
        while filled < FRAME {
            while filled < FRAME {
                let sample = next(&mut self.wav).map_err(|why| failed(&self.path, why))?;
                let Some(mut sample) = sample else {
                    break;
                };
                if channels == 2 {
                    let right = next(&mut self.wav).map_err(|why| failed(&self.path, why))?;
                    sample = f32::midpoint(sample, right.unwrap_or(sample));
                }
                if let Some(slot) = frame.get_mut(filled) {
                    *slot = sample;
                }
                filled += 1;
            }
            if filled < FRAME {
                self.wav
                    .seek(0)
                    .map_err(|source| failed(&self.path, source.to_string()))?;
            }
        }
        Ok(())
    }
}

/// The next sample from -1 to 1, whatever its kind; nothing at the end.
fn next(wav: &mut hound::WavReader<BufReader<File>>) -> Result<Option<f32>, String> {
    let spec = wav.spec();
    let sample = match spec.sample_format {
        hound::SampleFormat::Float => wav.samples::<f32>().next(),
        hound::SampleFormat::Int => {
            let full = 2.0f32.powi(i32::from(spec.bits_per_sample) - 1);
            let sample = wav.samples::<i32>().next();
            sample.map(|sample| sample.map(|sample| sample as f32 / full))
        }
    };
    let sample = sample.transpose().map_err(|source| source.to_string())?;
    Ok(sample.map(|sample| {
        if sample.is_finite() {
            sample.clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }))
}
