//! Sources of motion. A camera's tracker implements [`Capture`] as a clip does; the rest of the program does not distinguish them.

use crate::SendError;
use spmm3::MotionParams;
use std::time::Instant;

/// One captured motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// When light fell on the sensor, or what comes closest to it: latency is counted from here.
    pub at: Instant,
    /// The captured motion.
    pub motion: MotionParams,
    /// How sure it is of the face in the motion, 0..=1; nothing where the source has none, as a headset or a recording of a body.
    pub face: Option<f32>,
}

/// A source of motion that sets the pace.
pub trait Capture: Send {
    /// Waits for the next motion; `None` when there is no more. Called from one thread, again and again; a source that has
    /// several ready gives the newest.
    ///
    /// # Errors
    /// If the source fails for good. A tracker that loses the person for a moment leaves frames out instead.
    fn next(&mut self) -> Result<Option<Captured>, SendError>;
}
