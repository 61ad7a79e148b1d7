//! A call's voice, for who plays it: the call itself belongs to a lane.

use link_codec::Micros;
use link_voice::{Voice, VoiceError, VoicePlayout, VoiceStatistics};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One person's voice, shared by the call that it comes from and by the thread that plays it.
#[derive(Debug, Clone, Default)]
pub struct CallVoice(Arc<Mutex<Heard>>);

#[derive(Debug, Default)]
struct Heard {
    /// There where the voice is played; else packets are dropped as they come.
    playout: Option<VoicePlayout>,
    /// What is added to a frame's capture by the sender's clock until it is due by this side's, microseconds.
    motion_offset: Option<i64>,
}

impl CallVoice {
    /// From now on packets are kept for [`Self::play`], which is to be called regularly.
    ///
    /// # Errors
    /// If voice cannot be decoded here.
    pub fn listen(&self) -> Result<(), VoiceError> {
        let playout = VoicePlayout::new()?;
        self.heard().playout = Some(playout);
        Ok(())
    }

    /// The sound whose first sample is heard at `now`, 48 kHz; together with the motion, if that takes longer.
    pub fn play(&self, now: Micros, out: &mut [f32]) {
        let mut heard = self.heard();
        let motion_offset = heard.motion_offset;
        match &mut heard.playout {
            Some(playout) => playout.play(now, motion_offset, out),
            None => out.fill(0.0),
        }
    }

    /// What became of its packets; nothing where it is not played.
    #[must_use]
    pub fn statistics(&self) -> Option<VoiceStatistics> {
        self.heard().playout.as_ref().map(VoicePlayout::statistics)
    }

    pub(super) fn push(&self, voice: Voice, arrived: Micros) {
        if let Some(playout) = &mut self.heard().playout {
            playout.push(voice, arrived);
        }
    }

    pub(super) fn follow(&self, motion_offset: Option<i64>) {
        self.heard().motion_offset = motion_offset;
    }

    /// Another connection has begun.
    pub(super) fn reset(&self) {
        let mut heard = self.heard();
        heard.motion_offset = None;
        if let Some(playout) = &mut heard.playout {
            playout.reset();
        }
    }

    fn heard(&self) -> MutexGuard<'_, Heard> {
        // Samples stay samples after a panic elsewhere.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
