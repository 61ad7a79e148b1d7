//! Levels of detail: the more important part of the Gaussians, for when not all can be drawn in time.

use crate::KernelError;
use crate::state::MOST_LANES;
use crate::{check_count, check_range};

/// Which Gaussians are drawn, and by how much each grows to close the holes of those it replaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Detail {
    kept: Vec<u32>,
    /// For every Gaussian, drawn or not, padded by a vector's length.
    log2_growth: Vec<f32>,
}

impl Detail {
    /// Of an avatar's `gaussians` the ones whose ascending indices are in `kept`, each with what is added to the log2 of its
    /// scales.
    ///
    /// # Errors
    /// If the indices do not ascend or reach beyond the avatar's, or there is not one growth for each.
    pub fn new(gaussians: usize, kept: Vec<u32>, log2_growth: &[f32]) -> Result<Self, KernelError> {
        check_count("growths of Gaussians", log2_growth.len(), kept.len())?;
        if !kept.is_sorted_by(|a, b| a < b) {
            return Err(KernelError::Order);
        }
        check_range(
            &(0..kept.last().map_or(0, |last| *last as usize + 1)),
            gaussians,
        )?;
        let mut all = vec![0.0; gaussians + MOST_LANES];
        for (index, growth) in kept.iter().zip(log2_growth) {
            all[*index as usize] = *growth;
        }
        Ok(Self {
            kept,
            log2_growth: all,
        })
    }

    /// Number of Gaussians drawn.
    #[must_use]
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether none are.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    pub(super) fn kept(&self) -> &[u32] {
        &self.kept
    }

    pub(super) fn log2_growth(&self) -> &[f32] {
        &self.log2_growth
    }

    /// Number of Gaussians of the avatar.
    pub(super) fn of(&self) -> usize {
        self.log2_growth.len() - MOST_LANES
    }
}
