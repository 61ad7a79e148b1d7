//! Who is sent in the call: an avatar, a motion and a voice, each a file.

use anyhow::{Context, ensure};
use mon3tr::stills::load_avatar;
use spmm3::{LOOP_SECONDS, MotionClip};
use std::path::{Path, PathBuf};

/// Of the built-in motion, frames a second.
const MOTION_RATE: f64 = 30.0;

/// Of the made-up voice: samples a second, seconds, and from one syllable to the next.
const RATE: u32 = 48_000;
const SPOKEN: u32 = 10;
const SYLLABLE: u32 = RATE / 5;

/// Files of what is sent.
#[derive(Debug)]
pub(super) struct Person {
    pub(super) avatar: PathBuf,
    pub(super) motion: PathBuf,
    pub(super) voice: PathBuf,
}

impl Person {
    /// With this motion and voice; what is missing is made and put into `folder`.
    ///
    /// # Errors
    /// If a file is not there, or cannot be written.
    pub(super) fn open(
        avatar: &Path,
        motion: Option<&Path>,
        voice: Option<&Path>,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        for file in [Some(avatar), motion, voice].into_iter().flatten() {
            ensure!(file.is_file(), "there is no file {}", file.display());
        }
        let motion = match motion {
            Some(motion) => motion.to_owned(),
            None => built_in(avatar, folder)?,
        };
        let voice = match voice {
            Some(voice) => voice.to_owned(),
            None => syllables(folder)?,
        };
        Ok(Self {
            avatar: avatar.to_owned(),
            motion,
            voice,
        })
    }
}

/// The built-in motion, as a file.
fn built_in(avatar: &Path, folder: &Path) -> anyhow::Result<PathBuf> {
    let (avatar, _) = load_avatar(avatar)?;
    let clip = MotionClip::built_in(
        &avatar.skeleton,
        &avatar.expressions,
        LOOP_SECONDS,
        MOTION_RATE,
    );
    let clip = MotionClip {
        expression_basis: Some(avatar.expression_basis.clone()),
        ..clip.context("cannot perform the built-in motion")?
    };
    let file = folder.join("motion.npz");
    let bytes = clip.to_npz(&avatar.skeleton)?;
    std::fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}

/// Syllables of a voice of 120 Hz, one of three of them a pause: no speech, but as much for an encoder to do.
fn syllables(folder: &Path) -> anyhow::Result<PathBuf> {
    let file = folder.join("voice.wav");
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let write = || {
        let mut wav = hound::WavWriter::create(&file, spec)?;
        for k in 0..SPOKEN * RATE {
            wav.write_sample(sample(k))?;
        }
        wav.finalize()
    };
    write().with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}

#[expect(clippy::cast_possible_truncation, reason = "it is within 16 bits")]
fn sample(k: u32) -> i16 {
    let (syllable, within) = (k / SYLLABLE, f64::from(k % SYLLABLE) / f64::from(SYLLABLE));
    if syllable % 3 == 2 {
        return 0;
    }
    let turns = |hz: f64| std::f64::consts::TAU * hz * f64::from(k) / f64::from(RATE);
    // A formant for each, of five vowels.
    let formant = [300.0, 450.0, 600.0, 800.0, 500.0][syllable as usize % 5];
    let pulse = (-6.0 * (f64::from(k) * 120.0 / f64::from(RATE)).fract()).exp();
    let loud = 0.6 * (std::f64::consts::PI * within).sin();
    (loud * pulse * turns(formant).sin() * f64::from(i16::MAX)) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_made_up_voice_is_one_that_is_sent() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = syllables(folder.path()).expect("it is written");
        sender::VoiceFile::open(&file).expect("it fits");
        let wav = hound::WavReader::open(&file).expect("it is one");
        let loudest = wav
            .into_samples::<i16>()
            .map(|one| one.expect("whole").abs());
        assert!(loudest.max() > Some(5000), "it is heard");
    }
}
