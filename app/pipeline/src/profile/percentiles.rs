//! Percentiles of a time, as every table of this house gives them: nearest rank, so that each is a time that was measured.

use serde::Serialize;

/// Percentiles of a time, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Samples.
    pub count: usize,
    /// Mean. Means of parts add up to the mean of their sum; percentiles do not.
    pub mean_ms: f64,
    /// Median.
    pub p50_ms: f64,
    /// 95th percentile.
    pub p95_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Longest.
    pub max_ms: f64,
}

impl Percentiles {
    /// Nearest-rank percentiles; `None` without samples.
    #[must_use]
    pub fn of(samples: &[f64]) -> Option<Self> {
        let mut sorted = samples.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |percent: usize| {
            let rank = (sorted.len() * percent).div_ceil(100);
            sorted.get(rank.saturating_sub(1)).copied()
        };
        Some(Self {
            count: sorted.len(),
            p50_ms: at(50)?,
            p95_ms: at(95)?,
            p99_ms: at(99)?,
            max_ms: at(100)?,
            mean_ms: sorted.iter().sum::<f64>() / sorted.len() as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank() {
        let samples: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let of = Percentiles::of(&samples).expect("there are samples");
        assert_eq!(
            (of.count, of.p50_ms, of.p95_ms, of.p99_ms, of.max_ms),
            (200, 100.0, 190.0, 198.0, 200.0),
            "of 1..=200"
        );
        assert!((of.mean_ms - 100.5).abs() < 1e-12, "the mean of 1..=200");
        assert_eq!(Percentiles::of(&[]), None, "of nothing");
    }
}
