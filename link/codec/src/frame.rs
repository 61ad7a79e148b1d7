//! One captured motion with its sequence number and capture time.

use spmm3::MotionParams;

/// Microseconds of one program's own clock, which never goes back. Two programs' clocks differ by an unknown offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Micros(pub u64);

/// What the sender captured at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MotionFrame {
    /// Grows by one a frame, from 1.
    pub sequence: u32,
    /// When it was captured, by the sender's clock.
    pub captured: Micros,
    /// The 215 motion parameters and the root translation.
    pub motion: MotionParams,
}
