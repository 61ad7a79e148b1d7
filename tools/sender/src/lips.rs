//! The mouth of the voice that is sent, between the thread of the voice and that of the motion: the newest one only.

use crate::{SendError, VoiceSource};
use link_call::Privacy;
use link_voice::FRAME;
use lip_sync::{Listener, Mouth};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A mouth that is older belongs to a voice that has stopped: a microphone that is away says nothing.
const OLDEST: Duration = Duration::from_millis(200);

/// What the mouth does that speaks. Clones are the same mouth.
#[derive(Debug, Clone, Default)]
pub struct Lips(Arc<Mutex<Heard>>);

#[derive(Debug, Default)]
struct Heard {
    mouth: Mouth,
    at: Option<Instant>,
}

impl Lips {
    /// Shuts the mouth: of a microphone that is muted.
    pub fn silence(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Heard::default();
    }

    /// The mouth at `now`; shut if nothing was heard for 200 ms.
    #[must_use]
    pub fn at(&self, now: Instant) -> Mouth {
        let heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = heard
            .at
            .is_some_and(|at| now.saturating_duration_since(at) < OLDEST);
        if fresh { heard.mouth } else { Mouth::default() }
    }

    fn speak(&self, mouth: Mouth, now: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Heard {
            mouth,
            at: Some(now),
        };
    }
}

/// A source of voice that moves lips.
pub struct Overheard<'a> {
    source: &'a mut dyn VoiceSource,
    /// Nothing where its weights are damaged: the voice is sent all the same.
    listener: Option<Listener>,
    lips: Lips,
    privacy: Privacy,
}

impl std::fmt::Debug for Overheard<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Overheard").finish_non_exhaustive()
    }
}

impl<'a> Overheard<'a> {
    /// `source`, whose voice moves `lips` unless it is muted.
    pub fn new(source: &'a mut dyn VoiceSource, lips: Lips, privacy: Privacy) -> Self {
        let listener = Listener::new()
            .inspect_err(|error| log::error!("{error}: the mouth stays shut"))
            .ok();
        Self {
            source,
            listener,
            lips,
            privacy,
        }
    }
}

impl VoiceSource for Overheard<'_> {
    fn begin(&mut self) {
        self.source.begin();
        if let Some(listener) = &mut self.listener {
            listener.silence();
        }
    }

    fn next(&mut self, frame: &mut [f32; FRAME]) -> Result<Option<Instant>, SendError> {
        let spoken = self.source.next(frame)?;
        if let (Some(_), Some(listener)) = (spoken, &mut self.listener) {
            let mouth = listener.hear(frame);
            if self.privacy.state().muted {
                self.lips.silence();
            } else {
                self.lips.speak(mouth, Instant::now());
            }
        }
        Ok(spoken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mouth_shuts_when_it_is_silenced_and_when_its_voice_stops() {
        let (lips, now) = (Lips::default(), Instant::now());
        assert_eq!(lips.at(now), Mouth::default(), "at rest");
        let open = Mouth { weights: [0.5; 7] };
        lips.clone().speak(open, now);
        assert_eq!(lips.at(now), open, "the newest");
        assert_eq!(lips.at(now + OLDEST), Mouth::default(), "too old");
        lips.silence();
        assert_eq!(lips.at(now), Mouth::default(), "silenced");
    }
}
