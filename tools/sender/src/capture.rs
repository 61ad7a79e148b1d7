//! Where motion comes from. A camera's tracker implements [`Capture`] as a clip does; nothing else knows the difference.

use crate::SendError;
use spmm3::MotionParams;
use std::time::Instant;

/// One captured motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// When light fell on the sensor, or what comes closest to it: latency is counted from here.
    pub at: Instant,
    /// What was seen.
    pub motion: MotionParams,
}

/// A source of motion that sets the pace.
pub trait Capture: Send {
    /// Waits for the next motion; `None` when there is no more. Called from one thread, again and again; a source that has
    /// several ready gives the newest.
    ///
    /// # Errors
    /// If the source fails for good. What is lost for a moment is left out instead.
    fn next(&mut self) -> Result<Option<Captured>, SendError>;
}
