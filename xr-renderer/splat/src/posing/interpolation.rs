//! Where a picture lies between states.

use super::input::StateId;

/// A place between two states, or beyond the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interpolation {
    pub(super) from: StateId,
    pub(super) to: StateId,
    pub(super) share: f32,
    pub(super) level: usize,
}

impl Interpolation {
    /// Held within 0..=2, and at the later state where `share` is no number.
    pub(crate) fn new(from: StateId, to: StateId, share: f32, level: usize) -> Self {
        let share = if share.is_nan() { 1.0 } else { share };
        Self {
            from,
            to,
            share: share.clamp(0.0, 2.0),
            level,
        }
    }
}
