//! Adam for the deformation bases, whose derivatives are never stored.

use crate::error::{ModelError, check_count};
use crate::model::Model;
use crate::posed::Posed;

/// Which bases a step moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moved {
    /// All, as Adam has it: those without a derivative go on by their momentum.
    All,
    /// Groups of 16 neighbouring Gaussians of which one has a derivative; the others' numbers and moments stay. Cheaper, and bases of
    /// Gaussians that a picture does not show are left alone.
    Seen,
}

/// Adam's moments of the bases, row-major [14, B, N_g] each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BasisAdam {
    /// Mean of the derivatives by each number, not yet corrected for its start at 0.
    pub first: Vec<f32>,
    /// Mean of their squares.
    pub second: Vec<f32>,
    /// Steps that were made.
    pub steps: u32,
}

impl BasisAdam {
    /// Before the first step, for so many numbers.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            first: vec![0.0; count],
            second: vec![0.0; count],
            steps: 0,
        }
    }
}
