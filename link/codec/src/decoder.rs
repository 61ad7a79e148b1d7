//! The receiving side: one session's messages as frames. What it refuses leaves it as it was.

use crate::decode_error::{DecodeError, DecodeErrorCounts};
use crate::window::Window;
use crate::{KIND_COMPACT, KIND_PAPER, MotionFrame, compact, paper};

/// Reads one session's messages.
#[derive(Debug)]
pub struct Decoder {
    session: u32,
    window: Window,
    errors: DecodeErrorCounts,
}

impl Decoder {
    /// A decoder for one session.
    #[must_use]
    pub fn new(session: u32) -> Self {
        Self {
            session,
            window: Window::new(),
            errors: DecodeErrorCounts::default(),
        }
    }

    /// The frame of a message, whichever codec wrote it. Frames may come in any order within the window of 64.
    ///
    /// # Errors
    /// The reason why the message is not to be shown; it is counted.
    pub fn decode(&mut self, message: &[u8]) -> Result<MotionFrame, DecodeError> {
        self.read(message)
            .inspect_err(|error| self.errors.add(*error))
    }

    fn read(&mut self, message: &[u8]) -> Result<MotionFrame, DecodeError> {
        match message.first() {
            None => Err(DecodeError::Length),
            Some(&KIND_PAPER) => {
                let (session, frame) = paper::decode(message)?;
                if session != self.session {
                    return Err(DecodeError::ForeignSession);
                }
                self.window.admit(frame.sequence, frame.captured)?;
                self.window.insert(frame.sequence, frame.captured, None);
                Ok(frame)
            }
            Some(&KIND_COMPACT) => {
                let (frame, grid) = compact::decode(self.session, message, &self.window)?;
                self.window
                    .insert(frame.sequence, frame.captured, Some(&grid));
                Ok(frame)
            }
            Some(_) => Err(DecodeError::Kind),
        }
    }

    /// What was refused so far.
    #[must_use]
    pub fn errors(&self) -> &DecodeErrorCounts {
        &self.errors
    }

    /// What to say in feedback: the newest sequence (0 before any), and a bit for each of the 64 frames before it, bit 0 for the one just
    /// before.
    #[must_use]
    pub fn feedback(&self) -> (u32, u64) {
        (self.window.newest(), self.window.received())
    }
}
