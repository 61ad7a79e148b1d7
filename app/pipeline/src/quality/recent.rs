//! What the last pictures cost at the present step, and what they would have cost at another.

use super::Quality;

/// Pictures that are remembered: two thirds of a second at 90 Hz.
pub(super) const CAPACITY: usize = 64;

/// Share of a cost that is taken to follow its cause (pixels, Gaussians) on the way down. A tile with half the pixels or a
/// Gaussian less saves less than its share; on the way up the whole cost is taken to follow, so that a doubtful climb is
/// not tried.
const SAVED: f64 = 0.85;

/// What one picture took on the GPU, and how it met the display.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PictureCost {
    /// [`Quality::step`] it was drawn with: pictures of an earlier quality may still be in flight after a change.
    pub step: usize,
    /// What grows with the pixels, ms: raster, scaling up. All times 0 where the device has no clock; then only misses count.
    pub pixels_ms: f64,
    /// What grows with the Gaussians, ms: upload, bind, interpolation, projection, tile lists.
    pub gaussians_ms: f64,
    /// The sort, ms; 0 where this picture needed none.
    pub sort_ms: f64,
    /// What no quality shortens, ms: networks and skinning of new poses, where the device has them.
    pub fixed_ms: f64,
    /// Display periods that showed the picture before once more because this one was not ready.
    pub late_periods: u32,
}

impl PictureCost {
    /// All of the GPU's time, ms.
    #[must_use]
    pub fn total_ms(&self) -> f64 {
        self.pixels_ms + self.gaussians_ms + self.sort_ms + self.fixed_ms
    }

    /// The same with numbers that are no times (negative, NaN, infinite) as 0.
    pub(super) fn sane(mut self) -> Self {
        for ms in [
            &mut self.pixels_ms,
            &mut self.gaussians_ms,
            &mut self.sort_ms,
            &mut self.fixed_ms,
        ] {
            if !ms.is_finite() || *ms < 0.0 {
                *ms = 0.0;
            }
        }
        self
    }
}

/// The last pictures of one step, oldest overwritten first.
#[derive(Debug)]
pub(super) struct Recent {
    costs: [PictureCost; CAPACITY],
    count: usize,
    next: usize,
}

impl Recent {
    pub(super) fn new() -> Self {
        Self {
            costs: [PictureCost::default(); CAPACITY],
            count: 0,
            next: 0,
        }
    }

    pub(super) fn clear(&mut self) {
        (self.count, self.next) = (0, 0);
    }

    pub(super) fn push(&mut self, cost: PictureCost) {
        self.costs[self.next] = cost;
        self.next = (self.next + 1) % CAPACITY;
        self.count = (self.count + 1).min(CAPACITY);
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Whether anything was measured at all.
    pub(super) fn has_times(&self) -> bool {
        self.costs[..self.count].iter().any(|c| c.total_ms() > 0.0)
    }

    /// Milliseconds that a picture would take `at` another step, as the nearest-rank `percent` of the last `among` pictures
    /// drawn `with` the present one.
    pub(super) fn predicted(
        &self,
        with: Quality,
        at: Quality,
        among: usize,
        percent: usize,
    ) -> f64 {
        let among = among.min(self.count);
        let down = at.step > with.step;
        let follow = |ratio: f32| {
            let ratio = f64::from(ratio);
            if down {
                1.0 - SAVED * (1.0 - ratio)
            } else {
                ratio
            }
        };
        let pixels = follow(at.pixel_share() / with.pixel_share());
        let gaussians = follow(at.kept_share() / with.kept_share());
        let sorts = f64::from(with.sort_every) / f64::from(at.sort_every);
        let mut totals = [0.0; CAPACITY];
        let longest_sort = self.last(among).map(|c| c.sort_ms).fold(0.0, f64::max);
        for (total, cost) in totals.iter_mut().zip(self.last(among)) {
            // More sorts than now: pictures that had none will have one, too.
            let sort = if sorts > 1.0 {
                longest_sort
            } else {
                cost.sort_ms * sorts
            };
            *total =
                cost.pixels_ms * pixels + (cost.gaussians_ms + sort) * gaussians + cost.fixed_ms;
        }
        let totals = &mut totals[..among];
        totals.sort_unstable_by(f64::total_cmp);
        let rank = (among * percent).div_ceil(100).saturating_sub(1);
        totals.get(rank).copied().unwrap_or(0.0)
    }

    /// The last `among` pictures, the newest first.
    fn last(&self, among: usize) -> impl Iterator<Item = &PictureCost> {
        (1..=among).map(|back| &self.costs[(self.next + CAPACITY - back) % CAPACITY])
    }
}
