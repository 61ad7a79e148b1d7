//! How good an avatar of a scan is, in numbers: like the scan, nothing beside the body, no holes in it.

pub mod coverage;
mod grown;
pub mod likeness;

use crate::scan::Scan;
use serde::Serialize;

/// Percentiles of a set of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Percentiles {
    /// Half are less, metres.
    pub p50: f32,
    /// Nine tenths are less, metres.
    pub p90: f32,
    /// All but a hundredth are less, metres.
    pub p99: f32,
}

impl Percentiles {
    /// Of lengths in any order; 0 if there are none.
    #[must_use]
    pub fn of(mut lengths: Vec<f32>) -> Self {
        lengths.sort_unstable_by(f32::total_cmp);
        let at = |percent: usize| {
            let last = lengths.len().saturating_sub(1);
            lengths.get(last * percent / 100).copied().unwrap_or(0.0)
        };
        Self {
            p50: at(50),
            p90: at(90),
            p99: at(99),
        }
    }
}

/// The largest standard deviation of any Gaussian, metres.
#[must_use]
pub fn longest_axis(scan: &Scan) -> f32 {
    scan.scales
        .iter()
        .map(|s| s.max_element())
        .fold(0.0, f32::max)
}
