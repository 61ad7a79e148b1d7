//! Which frames have come: tells new from replayed and late, and keeps the grids that later frames may be predicted from.

use super::Refusal;
use super::grid::{Grid, VALUES};
use crate::Micros;

/// Frames before the newest that may still come, and that feedback tells of.
pub(super) const WINDOW: u32 = 64;
/// A late frame may be predicted from another one that is older by as much again.
const SLOTS: usize = 128;

#[derive(Debug, Clone)]
struct Slot {
    sequence: u32,
    captured: Micros,
    has_grid: bool,
    grid: Grid,
}

/// The frames that have come of late.
#[derive(Debug)]
pub(super) struct Window {
    newest: u32,
    slots: Vec<Slot>,
}

impl Window {
    pub(super) fn new() -> Self {
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
    pub(super) fn newest(&self) -> u32 {
        self.newest
    }

    fn slot(&self, sequence: u32) -> Option<&Slot> {
        let slot = &self.slots[sequence as usize % SLOTS];
        (sequence != 0 && slot.sequence == sequence).then_some(slot)
    }

    /// When a frame that is here was captured, and its grid if it has one.
    pub(super) fn get(&self, sequence: u32) -> Option<(Micros, &Grid)> {
        let slot = self.slot(sequence)?;
        slot.has_grid.then_some((slot.captured, &slot.grid))
    }

    /// A bit for each of the 64 frames before the newest.
    pub(super) fn received(&self) -> u64 {
        (0..WINDOW)
            .filter(|bit| self.slot(self.newest.saturating_sub(bit + 1)).is_some())
            .fold(0, |bits, bit| bits | 1 << bit)
    }

    /// Whether a frame may come now. Capture times grow strictly with the sequence.
    pub(super) fn admit(&self, sequence: u32, captured: Micros) -> Result<(), Refusal> {
        if sequence == 0 || self.newest.saturating_sub(sequence) > WINDOW {
            return Err(Refusal::Late);
        }
        if self.slot(sequence).is_some() {
            return Err(Refusal::Replayed);
        }
        let contradicts = |slot: &Slot| {
            slot.sequence != 0 && (slot.sequence < sequence) != (slot.captured < captured)
        };
        if self.slots.iter().any(contradicts) {
            return Err(Refusal::TimeBackwards);
        }
        Ok(())
    }

    /// Takes a frame in that was admitted.
    pub(super) fn insert(&mut self, sequence: u32, captured: Micros, grid: Option<&Grid>) {
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
