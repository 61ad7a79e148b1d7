//! One captured motion with its sequence number and capture time.

use spmm3::MotionParams;

/// Microseconds of one program's own clock, which never goes back. Two programs' clocks differ by an unknown offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Micros(pub u64);

impl Micros {
    /// Times from here on (146 000 years) are refused: differences of earlier ones fit an `i64`.
    pub const LATEST: Self = Self(1 << 62);

    /// To compute differences with; of a time beyond [`Self::LATEST`], that one.
    #[must_use]
    pub fn signed(self) -> i64 {
        self.0.min(Self::LATEST.0).cast_signed()
    }
}

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
