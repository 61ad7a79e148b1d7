//! People's voices together, from the loudspeaker.

use glam::Vec3;
use link_playout::Clock;
use link_voice::{VoiceError, VoicePlayer, VoiceQueue};
use sound_devices::{Loudspeaker, SoundError, SoundServer};
use spatial_sound::Binaural;
use std::time::{Duration, Instant};
use voice_processing::FarEnd;

/// Samples that are made at a time: 10 ms.
pub const MIXED: usize = 480;
/// The same in time.
pub const MIXED_TIME: Duration = Duration::from_micros(10_000);

/// Why voices are not heard.
#[derive(Debug, thiserror::Error)]
pub enum UnheardError {
    /// There is no loudspeaker.
    #[error(transparent)]
    Sound(#[from] SoundError),
    /// Voice cannot be decoded here.
    #[error(transparent)]
    Voice(#[from] VoiceError),
}

/// Plays `voices` on the loudspeaker of that name, or on the system's own choice, until what is returned is dropped. `far_end` is told what the
/// loudspeaker plays.
///
/// # Errors
/// If there is no such loudspeaker, or voice cannot be decoded.
pub fn play_voices(
    name: Option<&str>,
    voices: &[VoiceQueue],
    clock: Clock,
    far_end: Option<FarEnd>,
) -> Result<Loudspeaker, UnheardError> {
    let server = SoundServer::find()?;
    let mut mixer = VoiceMixer::listen(voices)?;
    let fill = move |at: Instant, device: Duration, out: &mut [[f32; 2]]| {
        let (pieces, _) = out.as_chunks_mut();
        for (piece, number) in pieces.iter_mut().zip(0..) {
            let at = at + number * MIXED_TIME;
            mixer.play(clock, at, device, piece);
            if let Some(far_end) = &far_end {
                // A microphone hears both.
                far_end.play(
                    at + device,
                    &piece.map(|[left, right]| (left + right) / 2.0),
                );
            }
        }
    };
    Ok(Loudspeaker::begin(&server, name, Box::new(fill))?)
}

/// All voices together, each from where its mouth is.
#[derive(Debug)]
pub struct VoiceMixer {
    voices: Vec<(VoicePlayer, Binaural)>,
    one: [f32; MIXED],
}

impl VoiceMixer {
    /// Listens to these.
    ///
    /// # Errors
    /// If voice cannot be decoded here.
    pub fn listen(voices: &[VoiceQueue]) -> Result<Self, VoiceError> {
        let voices = (voices.iter())
            .map(|voice| Ok::<_, VoiceError>((voice.listen()?, Binaural::default())));
        Ok(Self {
            voices: voices.collect::<Result<_, _>>()?,
            one: [0.0; MIXED],
        })
    }

    /// The samples, left and right, that are handed to the device at `at`, and heard `device` later.
    pub fn play(
        &mut self,
        clock: Clock,
        at: Instant,
        device: Duration,
        out: &mut [[f32; 2]; MIXED],
    ) {
        out.fill([0.0; 2]);
        for (voice, ears) in &mut self.voices {
            voice.play(clock.at(at), device, &mut self.one);
            ears.add(&self.one, voice.place().map(Vec3::from), out);
        }
        for sample in out.as_flattened_mut() {
            *sample = sample.clamp(-1.0, 1.0);
        }
    }
}
