//! Where the voice comes from that is sent.

use anyhow::Context;
use sender::{ProcessedMicrophone, VoiceFile, VoiceSource};
use sound_devices::{Microphone, SoundServer};
use std::path::PathBuf;
use voice_processing::{FarEnd, VoiceProcessor};

/// Options of commands that send a voice.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct VoiceOptions {
    /// Say what is in this WAV file (48 kHz), again and again, from when the first viewer comes
    #[arg(long, value_name = "FILE.wav", conflicts_with = "microphone")]
    voice: Option<PathBuf>,
    /// Say what this microphone hears, by the name that the sound server gives it [default: the server's own choice]
    #[arg(long, value_name = "NAME", num_args = 0..=1)]
    #[allow(
        clippy::option_option,
        reason = "not asked for, asked for, and asked for by name"
    )]
    microphone: Option<Option<String>>,
    /// What a loudspeaker beside the microphone plays.
    #[arg(skip)]
    far_end: Option<FarEnd>,
}

impl VoiceOptions {
    /// Lets the microphone leave out what the loudspeaker plays. Returns what that is to be told; nothing where no microphone was asked for.
    pub(crate) fn cancel_echo(&mut self) -> Option<FarEnd> {
        self.far_end = self.microphone.is_some().then(FarEnd::default);
        self.far_end.clone()
    }

    /// The voice that was asked for.
    ///
    /// # Errors
    /// If it is not there.
    pub(crate) fn open(&self) -> anyhow::Result<Option<Box<dyn VoiceSource>>> {
        if let Some(file) = &self.voice {
            return Ok(Some(Box::new(VoiceFile::open(file)?)));
        }
        let Some(name) = &self.microphone else {
            return Ok(None);
        };
        let microphone = SoundServer::find()
            .and_then(|server| Microphone::open(&server, name.as_deref()))
            .context("no microphone")?;
        println!("the microphone is {}", microphone.name());
        let processor = VoiceProcessor::new(self.far_end.as_ref());
        Ok(Some(Box::new(ProcessedMicrophone::new(
            microphone, processor,
        ))))
    }
}
