//! Times of a call, however long it takes, in memory that does not grow with it.

use app_pipeline::profile::Percentiles;

/// Times that are kept: two minutes at 30 Hz. Where there are more, every second is kept, then every fourth, and so on.
/// A call has seven of these for each person, whose memory becomes resident as it fills.
const KEPT: usize = 1 << 12;

/// Times, in milliseconds, of which percentiles are asked for.
#[derive(Debug)]
pub(super) struct Times {
    /// Evenly over the whole call.
    kept: Vec<f64>,
    /// One of so many is kept.
    every: usize,
    count: usize,
    sum: f64,
    longest: f64,
}

impl Times {
    pub(super) fn new() -> Self {
        Self {
            kept: Vec::with_capacity(KEPT),
            every: 1,
            count: 0,
            sum: 0.0,
            longest: f64::NEG_INFINITY,
        }
    }

    /// One more.
    pub(super) fn push(&mut self, ms: f64) {
        if self.count.is_multiple_of(self.every) {
            if self.kept.len() == KEPT {
                self.thin_out();
            }
            // A power of two divides what the last one did not skip.
            if self.count.is_multiple_of(self.every) {
                self.kept.push(ms);
            }
        }
        self.count += 1;
        self.sum += ms;
        self.longest = self.longest.max(ms);
    }

    fn thin_out(&mut self) {
        let mut is_kept = false;
        self.kept.retain(|_| {
            is_kept = !is_kept;
            is_kept
        });
        self.every *= 2;
    }

    /// Count, mean and longest of all, percentiles of those that were kept; nothing without any.
    pub(super) fn percentiles(&self) -> Option<Percentiles> {
        Some(Percentiles {
            count: self.count,
            mean_ms: self.sum / self.count as f64,
            max_ms: self.longest,
            ..Percentiles::of(&self.kept)?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(all: &[f64]) -> Times {
        let mut times = Times::new();
        all.iter().for_each(|ms| times.push(*ms));
        times
    }

    #[test]
    fn of_a_short_call_each_is_kept() {
        let all: Vec<f64> = (0..KEPT).map(|k| ((k * 7919) % KEPT) as f64).collect();
        let (told, exact) = (times(&all).percentiles(), Percentiles::of(&all));
        assert_eq!(told, exact, "as many as are kept");
        assert_eq!(times(&[]).percentiles(), None, "none");
    }

    #[test]
    fn a_day_takes_no_more_memory_and_is_told_as_well() {
        let mut random = 1_u32;
        let all: Vec<f64> = (0..24 * 3600 * 30)
            .map(|k| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // It drifts, so that any part of the day alone would be told from the whole.
                f64::from(random >> 16) / 65_536.0 + f64::from(k) * 1e-6
            })
            .collect();
        let times = times(&all);
        assert_eq!(times.kept.capacity(), KEPT, "no more than at the start");
        assert!(times.kept.len() > KEPT / 2 - 1, "{} kept", times.kept.len());
        let told = times.percentiles().expect("there are some");
        let exact = Percentiles::of(&all).expect("there are some");
        assert_eq!(
            (told.count, told.max_ms),
            (exact.count, exact.max_ms),
            "of all"
        );
        for (told, exact) in [
            (told.mean_ms, exact.mean_ms),
            (told.p50_ms, exact.p50_ms),
            (told.p95_ms, exact.p95_ms),
            (told.p99_ms, exact.p99_ms),
        ] {
            assert!((told - exact).abs() < 0.05, "{told} for {exact}");
        }
    }
}
