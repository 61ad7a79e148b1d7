//! What a person does and says, sent until it is over: motion on the calling thread, the voice on one of its own.

use app_session::SetAtEnd;
use app_session::own_motion::OwnMotion;
use link_call::Sender;
use link_playout::Clock;
use sender::{Capture, Captured, Lips, Overheard, SendError, UnseenFace, VoiceSource};
use spmm3::Expressions;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::ScopedJoinHandle;

/// A person who is sent.
pub struct Performance<'a> {
    /// Their motion.
    pub capture: &'a mut dyn Capture,
    /// The avatar's named expressions, for a face that the motion lacks.
    pub expressions: &'a Expressions,
    /// Their voice.
    pub voice: Option<&'a mut dyn VoiceSource>,
    /// Where the motion is shown to oneself.
    pub own: Option<&'a OwnMotion>,
}

impl std::fmt::Debug for Performance<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Performance").finish_non_exhaustive()
    }
}

impl Performance<'_> {
    /// Sends it to everyone who joins `host`, until the motion ends or `stop` is set. Where the face is not seen, lips follow the voice and
    /// eyes blink. A call that loses its voice ends, and sets `stop`.
    ///
    /// # Errors
    /// If motion or voice fail.
    pub fn send(self, host: &Sender, clock: Clock, stop: &AtomicBool) -> Result<(), SendError> {
        let lips = Lips::default();
        let mut moved = Mirrored {
            capture: UnseenFace::new(self.capture, self.expressions, lips.clone()),
            own: self.own,
        };
        let silent = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let said = self.voice.map(|voice| {
                let silent = &silent;
                let mut voice = Overheard::new(voice, lips, host.privacy());
                scope.spawn(move || {
                    let said = sender::say(&mut voice, host, clock, silent);
                    if said.is_err() {
                        stop.store(true, Relaxed);
                    }
                    said
                })
            });
            let sent = {
                let _ends_with = SetAtEnd(&silent);
                sender::send(host, &mut moved, clock, stop)
            };
            let said = said.map_or(Ok(Ok(())), ScopedJoinHandle::join);
            sent?;
            said.unwrap_or_else(|_| {
                log::error!("the thread of the voice has failed");
                Ok(())
            })
        })
    }
}

/// A capture whose motion is shown to oneself, too.
struct Mirrored<'a, C> {
    capture: C,
    own: Option<&'a OwnMotion>,
}

impl<C: Capture> Capture for Mirrored<'_, C> {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        let captured = self.capture.next()?;
        if let (Some(captured), Some(own)) = (&captured, self.own) {
            own.show(captured.at, &captured.motion);
        }
        Ok(captured)
    }
}
