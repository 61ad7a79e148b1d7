//! People's voices in a file, as a sound card would play them.

use anyhow::Context;
use link_playout::Clock;
use link_voice::{Pace, RATE, VoicePlayer, VoiceQueue};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Samples that are asked for at a time, as a sound card does: 10 ms.
const ASKED: usize = 480;
const ASKED_US: u64 = 10_000;

/// A WAV file that is written while it is there: 48 kHz, one channel, 16 bits.
#[derive(Debug)]
pub(crate) struct SoundFile {
    path: PathBuf,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), hound::Error>>,
}

impl SoundFile {
    /// Begins to write what is heard of these voices together, from now on.
    ///
    /// # Errors
    /// If the file cannot be written, or voice cannot be decoded here.
    pub(crate) fn begin(path: &Path, voices: &[VoiceQueue], clock: Clock) -> anyhow::Result<Self> {
        let cannot = || format!("cannot write {}", path.display());
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: RATE,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let wav = hound::WavWriter::create(path, spec).with_context(cannot)?;
        let players = voices.iter().map(VoiceQueue::listen);
        let players = players.collect::<Result<Vec<_>, _>>()?;
        let stop = Arc::<AtomicBool>::default();
        let stopped = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name("sound".to_owned())
            .spawn(move || play(wav, players, clock, &stopped))
            .context("cannot start a thread for the sound")?;
        Ok(Self {
            path: path.to_owned(),
            stop,
            thread,
        })
    }

    /// Ends the file.
    ///
    /// # Errors
    /// If it could not be written.
    pub(crate) fn end(self) -> anyhow::Result<()> {
        self.stop.store(true, Relaxed);
        let written = self.thread.join();
        let written = written.map_err(|_| anyhow::anyhow!("the thread of the sound has failed"))?;
        written.with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// Asks for sound at an even pace; where this thread is a little late, it asks for what it has missed.
fn play<W: std::io::Write + std::io::Seek>(
    mut wav: hound::WavWriter<W>,
    mut voices: Vec<VoicePlayer>,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), hound::Error> {
    let mut pace = Pace::begin(Instant::now(), Duration::from_micros(ASKED_US));
    let (mut mixed, mut one) = ([0.0f32; ASKED], [0.0f32; ASKED]);
    while !stop.load(Relaxed) {
        let heard = pace.next(Instant::now());
        std::thread::sleep(heard.saturating_duration_since(Instant::now()));
        mixed.fill(0.0);
        for voice in &mut voices {
            voice.play(clock.at(heard), &mut one);
            for (mixed, sample) in mixed.iter_mut().zip(&one) {
                *mixed += sample;
            }
        }
        for sample in mixed {
            wav.write_sample(as_16_bits(sample))?;
        }
    }
    wav.finalize()
}

#[allow(clippy::cast_possible_truncation, reason = "it is within 16 bits")]
fn as_16_bits(sample: f32) -> i16 {
    (sample.clamp(-1.0, 1.0) * f32::from(i16::MAX)).round() as i16
}
