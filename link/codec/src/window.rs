//! The frames that arrived recently: distinguishes new from replayed and late ones, and keeps the grids that later frames may be predicted
//! from.

use crate::Micros;
use crate::decode_error::DecodeError;
use crate::grid::{Grid, VALUES};

/// Frames before the newest that may still arrive, and that feedback reports.
pub(crate) const WINDOW: u32 = 64;
/// A late frame may be predicted from another one that is older by as much again.
const SLOTS: usize = 128;

#[derive(Debug, Clone)]
struct Slot {
    sequence: u32,
    captured: Micros,
    has_grid: bool,
    grid: Grid,
}

/// The frames that arrived recently.
#[derive(Debug)]
pub(crate) struct Window {
    newest: u32,
    slots: Vec<Slot>,
}

impl Window {
    pub(crate) fn new() -> Self {
        let empty = Slot {
            sequence: 0,
            captured: Micros(0),
            has_grid: false,
            grid: [0; VALUES],
        };
        Self {
            newest: 0,
            slots: vec![empty; SLOTS],
        }
    }

    /// The newest frame's sequence; 0 before any.
    pub(crate) fn newest(&self) -> u32 {
        self.newest
    }

    fn slot(&self, sequence: u32) -> Option<&Slot> {
        let slot = &self.slots[sequence as usize % SLOTS];
        (sequence != 0 && slot.sequence == sequence).then_some(slot)
    }

    /// When a frame that is here was captured, and its grid if it has one.
    pub(crate) fn get(&self, sequence: u32) -> Option<(Micros, &Grid)> {
        let slot = self.slot(sequence)?;
        slot.has_grid.then_some((slot.captured, &slot.grid))
    }

    /// A bit for each of the 64 frames before the newest.
    pub(crate) fn received(&self) -> u64 {
        (0..WINDOW)
            .filter(|bit| self.slot(self.newest.saturating_sub(bit + 1)).is_some())
            .fold(0, |bits, bit| bits | 1 << bit)
    }

    /// Refuses a frame that is late, replayed or out of order in time. Capture times grow strictly with the sequence.
    pub(crate) fn admit(&self, sequence: u32, captured: Micros) -> Result<(), DecodeError> {
        if sequence == 0 || self.newest.saturating_sub(sequence) > WINDOW {
            return Err(DecodeError::Late);
        }
        if self.slot(sequence).is_some() {
            return Err(DecodeError::Replayed);
        }
        let contradicts = |slot: &Slot| {
            slot.sequence != 0 && (slot.sequence < sequence) != (slot.captured < captured)
        };
        if self.slots.iter().any(contradicts) {
            return Err(DecodeError::TimeBackwards);
        }
        Ok(())
    }

    /// Keeps a frame that was admitted.
    pub(crate) fn insert(&mut self, sequence: u32, captured: Micros, grid: Option<&Grid>) {
        let slot = &mut self.slots[sequence as usize % SLOTS];
        slot.sequence = sequence;
        slot.captured = captured;
        slot.has_grid = grid.is_some();
        if let Some(grid) = grid {
            slot.grid = *grid;
        }
        self.newest = self.newest.max(sequence);
    }
}
