//! The steps of quality, in the order in which they are given up, and what each changes about the costs.

use serde::Serialize;

/// Shares of the Gaussians that the levels of detail keep, level 0 first: what [`spmm3::Importance::level`] is asked for at
/// the start.
pub const KEPT_SHARES: [f32; 4] = [1.0, 0.75, 0.5, 0.35];

/// What to draw a picture with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Place on the [`LADDER`], 0 the best.
    pub step: usize,
    /// Width and height relative to the display's own.
    pub resolution_scale: f32,
    /// Which of the [`KEPT_SHARES`] to draw.
    pub level: usize,
    /// A sort for every so many pictures.
    pub sort_every: u32,
}

/// Every quality, the best first: resolution, then Gaussians, then the sort.
pub const LADDER: [Quality; 8] = [
    quality(0, 1.0, 0, 1),
    quality(1, 0.85, 0, 1),
    quality(2, 0.7, 0, 1),
    quality(3, 0.6, 0, 1),
    quality(4, 0.6, 1, 1),
    quality(5, 0.6, 2, 1),
    quality(6, 0.6, 3, 1),
    quality(7, 0.6, 3, 2),
];

const fn quality(step: usize, resolution_scale: f32, level: usize, sort_every: u32) -> Quality {
    Quality {
        step,
        resolution_scale,
        level,
        sort_every,
    }
}

impl Quality {
    /// The quality of a step; of the last one for steps beyond.
    #[must_use]
    pub const fn of_step(step: usize) -> Self {
        LADDER[if step < LADDER.len() {
            step
        } else {
            LADDER.len() - 1
        }]
    }

    /// The share of the Gaussians that is drawn.
    #[must_use]
    pub const fn kept_share(self) -> f32 {
        KEPT_SHARES[self.level]
    }

    /// Pixels relative to the full picture.
    #[must_use]
    pub fn pixel_share(self) -> f32 {
        self.resolution_scale * self.resolution_scale
    }
}

impl std::fmt::Display for Quality {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (resolution, kept) = (100.0 * self.resolution_scale, 100.0 * self.kept_share());
        write!(
            f,
            "{resolution:.0} % resolution, {kept:.0} % of the Gaussians"
        )?;
        match self.sort_every {
            1 => Ok(()),
            n => write!(f, ", a sort every {n} pictures"),
        }
    }
}

/// Whether quality may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum QualityMode {
    /// It follows what the device can do.
    #[default]
    Adapt,
    /// It stays at this step, for measurements that can be repeated. Misses are counted all the same.
    Fixed(usize),
}
