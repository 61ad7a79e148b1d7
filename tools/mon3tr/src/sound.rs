//! People's voices together: from the loudspeaker, or in a file as a loudspeaker would play them.

use crate::report::file_of_format;
use anyhow::Context;
use call_member::{MIXED, MIXED_TIME, VoiceMixer, play_voices};
use link_playout::Clock;
use link_voice::{Pace, RATE, VoiceQueue};
use sound_devices::Loudspeaker;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use voice_processing::FarEnd;

/// Options of commands that play voices.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct SoundOptions {
    /// Write what is heard of all people together, left and right, as the loudspeaker would play it, and play nothing
    #[arg(long, value_name = "FILE.wav", value_parser = file_of_format("wav"))]
    sound: Option<PathBuf>,
    /// The loudspeaker, by the name that the sound server gives it [default: the server's own choice]
    #[arg(long, value_name = "NAME", conflicts_with = "sound")]
    loudspeaker: Option<String>,
    /// Who is told what the loudspeaker plays.
    #[arg(skip)]
    far_end: Option<FarEnd>,
}

impl SoundOptions {
    /// The file that is written.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.sound.as_deref()
    }

    /// Tells `far_end` what the loudspeaker plays.
    pub(crate) fn tell(&mut self, far_end: Option<FarEnd>) {
        self.far_end = far_end;
    }

    /// Plays these voices from now on. Where there is no loudspeaker and none was asked for, it says so, and they are not heard.
    ///
    /// # Errors
    /// If the file cannot be written, the loudspeaker asked for is not there, or voice cannot be decoded here.
    pub(crate) fn begin(&self, voices: &[VoiceQueue], clock: Clock) -> anyhow::Result<Sound> {
        if let Some(path) = &self.sound {
            return Ok(Sound::File(SoundFile::begin(path, voices, clock)?));
        }
        let asked = self.loudspeaker.as_deref();
        match play_voices(asked, voices, clock, self.far_end.clone()) {
            Ok(loudspeaker) => Ok(Sound::Loudspeaker(loudspeaker)),
            Err(why) if asked.is_some() => Err(why).context("no loudspeaker"),
            Err(why) => {
                let why = anyhow::Error::from(why);
                println!("no voice is heard: {why:#}; --sound FILE.wav writes it");
                Ok(Sound::Unheard)
            }
        }
    }
}

/// What plays.
#[derive(Debug)]
pub(crate) enum Sound {
    /// A file.
    File(SoundFile),
    /// The loudspeaker, until this is dropped.
    Loudspeaker(#[allow(dead_code, reason = "it plays while it is there")] Loudspeaker),
    /// There is no loudspeaker.
    Unheard,
}

impl Sound {
    /// Ends it.
    ///
    /// # Errors
    /// If the file could not be written.
    pub(crate) fn end(self) -> anyhow::Result<()> {
        match self {
            Self::File(file) => file.end(),
            Self::Loudspeaker(_) | Self::Unheard => Ok(()),
        }
    }
}

/// A WAV file that is written while it is there: 48 kHz, left and right, 16 bits.
#[derive(Debug)]
pub(crate) struct SoundFile {
    path: PathBuf,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), hound::Error>>,
}

impl SoundFile {
    fn begin(path: &Path, voices: &[VoiceQueue], clock: Clock) -> anyhow::Result<Self> {
        let cannot = || format!("cannot write {}", path.display());
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: RATE,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let wav = hound::WavWriter::create(path, spec).with_context(cannot)?;
        let mixer = VoiceMixer::listen(voices)?;
        let stop = Arc::<AtomicBool>::default();
        let stopped = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name("sound".to_owned())
            .spawn(move || write(wav, mixer, clock, &stopped))
            .context("cannot start a thread for the sound")?;
        Ok(Self {
            path: path.to_owned(),
            stop,
            thread,
        })
    }

    fn end(self) -> anyhow::Result<()> {
        self.stop.store(true, Relaxed);
        let written = self.thread.join();
        let written = written.map_err(|_| anyhow::anyhow!("the thread of the sound has failed"))?;
        written.with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// Asks for sound at an even pace; where this thread is a little late, it asks for what it has missed.
fn write<W: std::io::Write + std::io::Seek>(
    mut wav: hound::WavWriter<W>,
    mut mixer: VoiceMixer,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), hound::Error> {
    let mut pace = Pace::begin(Instant::now(), MIXED_TIME);
    let mut mixed = [[0.0f32; 2]; MIXED];
    while !stop.load(Relaxed) {
        let heard = pace.next(Instant::now());
        std::thread::sleep(heard.saturating_duration_since(Instant::now()));
        mixer.play(clock, heard, Duration::ZERO, &mut mixed);
        for sample in mixed.as_flattened() {
            wav.write_sample(as_16_bits(*sample))?;
        }
    }
    wav.finalize()
}

#[allow(clippy::cast_possible_truncation, reason = "it is within 16 bits")]
fn as_16_bits(sample: f32) -> i16 {
    (sample * f32::from(i16::MAX)).round() as i16
}
