//! The headset's microphone, as soon as the wearer allows it, and while they wear the headset.

use super::WearersLeave;
use app_pipeline::control::Control;
use link_voice::FRAME;
use sender::{ProcessedMicrophone, SendError, VoiceSource};
use sound_devices::{Microphone, SoundError, SoundServer};
use std::sync::Arc;
use std::time::{Duration, Instant};
use voice_processing::{FarEnd, VoiceProcessor};

/// Between two looks whether it may be opened.
const LOOKING: Duration = Duration::from_secs(1);
/// A source of voice does not wait longer than this.
const WAIT: Duration = Duration::from_millis(100);

/// A microphone that is opened once it may be, with echo and noise taken out.
pub(super) struct AllowedMicrophone {
    leave: Arc<dyn WearersLeave>,
    control: Control,
    far_end: FarEnd,
    opened: Option<ProcessedMicrophone>,
    looked: Option<Instant>,
    /// Whether it was told that it does not open.
    is_told: bool,
}

impl AllowedMicrophone {
    /// The one that Android chooses, without what `far_end` is told of the loudspeaker; silent while `control` is paused.
    pub(super) fn new(leave: Arc<dyn WearersLeave>, control: Control, far_end: FarEnd) -> Self {
        Self {
            leave,
            control,
            far_end,
            opened: None,
            looked: None,
            is_told: false,
        }
    }

    fn look(&mut self) {
        if self.looked.is_some_and(|at| at.elapsed() < LOOKING) {
            return;
        }
        self.looked = Some(Instant::now());
        if !self.leave.may_record() {
            return;
        }
        match open() {
            Ok(microphone) => {
                log::info!("the others hear you: the microphone is open");
                let processor = VoiceProcessor::new(Some(&self.far_end));
                self.opened = Some(ProcessedMicrophone::new(microphone, processor));
            }
            Err(why) if !std::mem::replace(&mut self.is_told, true) => {
                log::warn!("no one hears you: {why}");
            }
            Err(_) => {}
        }
    }
}

fn open() -> Result<Microphone, SoundError> {
    Microphone::open(&SoundServer::find()?, None)
}

impl VoiceSource for AllowedMicrophone {
    fn begin(&mut self) {
        if let Some(opened) = &mut self.opened {
            opened.begin();
        }
    }

    fn next(&mut self, frame: &mut [f32; FRAME]) -> Result<Option<Instant>, SendError> {
        if self.opened.is_none() {
            self.look();
        }
        if let Some(opened) = &mut self.opened {
            let heard = opened.next(frame)?;
            if self.control.is_paused() {
                // The headset is off, or another program is in front: what is said there is not for the call.
                frame.fill(0.0);
            }
            return Ok(heard);
        }
        std::thread::sleep(WAIT);
        Ok(None)
    }
}
