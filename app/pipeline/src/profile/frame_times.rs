//! The times of a motion frame, in one record that goes along with it.

use crate::concealment::ConcealmentState;
use std::time::Instant;

/// A motion frame's times, from its capture until its state of Gaussians is ready, by this machine's clock. A source of poses makes the
/// record ([`Self::new`]); each lane that the frame passes fills in its own part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameTimes {
    /// Counts motion frames handed to the lanes, from 1; 0 before.
    pub number: u64,
    /// Where its motion came from.
    pub source: ConcealmentState,
    /// When it was captured; unknown until the clocks have been compared, and for a pose that no frame brought.
    pub captured: Option<Instant>,
    /// When the datagram was here (for a pose that no frame brought: when it was made up).
    pub arrived: Instant,
    /// When it was due, which is its place on the time axis of motion: later than that of the frame before.
    pub due: Instant,
    /// When it left the jitter buffer.
    pub released: Instant,
    /// When the deform graph began and ended.
    pub inference: [Instant; 2],
    /// When its state was ready to be shown.
    pub ready: Instant,
}

impl FrameTimes {
    /// Of a frame that arrives, is due and is released at one moment, and whose capture is unknown.
    #[must_use]
    pub fn new(source: ConcealmentState, now: Instant) -> Self {
        Self {
            number: 0,
            source,
            captured: None,
            arrived: now,
            due: now,
            released: now,
            inference: [now; 2],
            ready: now,
        }
    }
}
