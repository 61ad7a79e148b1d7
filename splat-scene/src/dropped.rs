//! How many Gaussians of a file were left out, and why.

use std::fmt;

/// The single Gaussians that were left out, by the first reason found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Position not finite or beyond [`crate::MAX_COORDINATE`].
    pub position: usize,
    /// Rotation not finite or a quaternion of length zero.
    pub rotation: usize,
    /// Log-scale NaN or above [`crate::MAX_LOG_SCALE`].
    pub scale: usize,
    /// Opacity NaN.
    pub opacity: usize,
    /// Colour or SH coefficient not finite or beyond [`crate::MAX_COEFFICIENT`].
    pub colour: usize,
}

impl Dropped {
    /// All Gaussians left out.
    pub fn total(&self) -> usize {
        self.position + self.rotation + self.scale + self.opacity + self.colour
    }
}

impl fmt::Display for Dropped {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reasons = [
            (self.position, "position"),
            (self.rotation, "rotation"),
            (self.scale, "scale"),
            (self.opacity, "opacity"),
            (self.colour, "colour"),
        ];
        let mut first = true;
        for (count, what) in reasons.into_iter().filter(|(count, _)| *count > 0) {
            let comma = if first { "" } else { ", " };
            write!(out, "{comma}{count} for their {what}")?;
            first = false;
        }
        if first { out.write_str("none") } else { Ok(()) }
    }
}
