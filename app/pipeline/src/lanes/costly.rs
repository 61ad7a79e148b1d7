//! People whose Gaussians cost more than a picture may take: left out, so that the others go on.
//!
//! What counts is what the device counted: pairs of splat and tile, for each person. Who makes too many of them is left out of that very picture, and tried
//! again later: someone else may only have come too close. Who costs most of pictures that take seconds is left out for good.

use renderer_splat::renderer::SplatRenderer;
use std::time::{Duration, Instant};

/// A picture that takes the device longer is slow, ms.
const SLOW_MS: f64 = 1000.0;

/// So many slow pictures, one after the other, are no hiccup of the machine.
const SLOW_PICTURES: u32 = 2;

/// Whoever makes fewer pairs is not what makes a picture slow: a person who fills a picture of 1024x1024 makes about as many.
const LEAST_PAIRS: u64 = 1 << 19;

/// From being left out for too many pairs to the next try, which costs a projection where it fails.
const NEXT_TRY: Duration = Duration::from_secs(2);

/// Why a person was left out of pictures, and of how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    /// Pictures without them.
    pub pictures: u64,
    /// (Gaussian, tile) pairs that they made in the picture that was the reason.
    pub pairs: u64,
    /// Whether they stay left out: pictures with them took seconds.
    pub for_good: bool,
}

/// What a person's lanes know of it.
#[derive(Debug, Default)]
pub(super) struct Budget {
    /// When they are tried again, where they are left out and not for good.
    until: Option<Instant>,
    report: Option<LeftOut>,
}

impl Budget {
    /// Whether they are left out now.
    pub(super) fn is_exceeded(&self) -> bool {
        self.until.is_some() || self.report.is_some_and(|report| report.for_good)
    }

    /// What came of it; nothing where they never were left out.
    pub(super) fn report(&self) -> Option<LeftOut> {
        self.report
    }

    /// Before a picture: lets them in again if it is time, or counts the picture.
    pub(super) fn begin(&mut self, now: Instant) {
        if self.until.is_some_and(|until| now >= until) {
            self.until = None;
        }
        if self.is_exceeded()
            && let Some(report) = &mut self.report
        {
            report.pictures += 1;
        }
    }

    /// Leaves them out: for good, or until they are tried again. Returns whether this is to be told: once for each reason.
    pub(super) fn exceed(&mut self, pairs: u64, for_good: bool) -> bool {
        let is_new = (self.report).is_none_or(|report| for_good && !report.for_good);
        let pictures = self.report.map_or(0, |report| report.pictures) + 1;
        self.report = Some(LeftOut {
            pictures,
            pairs,
            for_good,
        });
        self.until = (!for_good).then(|| Instant::now() + NEXT_TRY);
        is_new
    }
}

/// Notices that pictures take seconds.
#[derive(Debug, Default)]
pub(super) struct SlowPictures {
    /// Which part of the last ones cost most, and how many of them there were.
    run: Option<(usize, u32)>,
}

impl SlowPictures {
    /// Takes note of the picture that was drawn. `number` says whose a part is, if it is a person's. Returns who costs most of several slow ones in a row,
    /// with the pairs they make and the milliseconds that the last one took.
    pub(super) fn note(
        &mut self,
        renderer: &SplatRenderer,
        number: impl Fn(usize) -> Option<usize>,
    ) -> Option<(usize, u64, f64)> {
        let took = took_ms(renderer);
        let pairs = renderer.part_pairs();
        self.judge(took, &pairs, number)
    }

    fn judge(
        &mut self,
        took_ms: f64,
        pairs: &[u64],
        number: impl Fn(usize) -> Option<usize>,
    ) -> Option<(usize, u64, f64)> {
        let people = (pairs.iter().enumerate())
            .filter_map(|(part, pairs)| Some((number(part)?, *pairs)))
            .filter(|(_, pairs)| *pairs >= LEAST_PAIRS);
        let dearest = people.max_by_key(|(_, pairs)| *pairs);
        let (Some((person, pairs)), true) = (dearest, took_ms > SLOW_MS) else {
            self.run = None;
            return None;
        };
        let pictures = match self.run {
            Some((before, pictures)) if before == person => pictures + 1,
            _ => 1,
        };
        if pictures < SLOW_PICTURES {
            self.run = Some((person, pictures));
            return None;
        }
        self.run = None;
        Some((person, pairs, took_ms))
    }
}

/// How long the device worked on what depends on the tiles that are covered; where it has no clock, on the whole picture.
fn took_ms(renderer: &SplatRenderer) -> f64 {
    let Some(picture) = renderer.picture_time() else {
        return 0.0;
    };
    if picture.stages.is_some() {
        let times = renderer.stage_times();
        return times.bin + times.raster;
    }
    let taken = picture
        .finished
        .saturating_duration_since(picture.submitted);
    taken.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_costs_most_of_two_slow_pictures_in_a_row_goes() {
        let mut slow = SlowPictures::default();
        let all = |part: usize| (part < 2).then_some(10 + part);
        // The scenery's part is nobody's.
        let pairs = [600_000, 3_000_000, 9_000_000];
        assert_eq!(slow.judge(1_500.0, &pairs, all), None, "the first");
        assert_eq!(slow.judge(20.0, &pairs, all), None, "a quick one");
        assert_eq!(slow.judge(1_500.0, &pairs, all), None, "the first again");
        let other = [4_000_000, 3_000_000, 0];
        assert_eq!(slow.judge(1_500.0, &other, all), None, "another one's");
        assert_eq!(
            slow.judge(1_200.0, &other, all),
            Some((10, 4_000_000, 1_200.0)),
            "the second"
        );
        let few = [500_000, 100_000, 9_000_000];
        for _ in 0..5 {
            assert_eq!(slow.judge(9_000.0, &few, all), None, "a slow machine");
        }
    }

    #[test]
    fn a_person_is_told_of_once_and_tried_again_unless_left_out_for_good() {
        let mut budget = Budget::default();
        assert!(!budget.is_exceeded() && budget.report().is_none(), "new");
        assert!(budget.exceed(9_000_000, false), "to be told");
        let now = Instant::now();
        budget.begin(now);
        assert!(budget.is_exceeded(), "not yet");
        budget.begin(now + NEXT_TRY);
        assert!(!budget.is_exceeded(), "tried again");
        assert!(!budget.exceed(9_000_001, false), "told before");
        assert!(budget.exceed(4_000_000, true), "another reason");
        budget.begin(now + NEXT_TRY * 10);
        assert!(budget.is_exceeded(), "for good");
        let report = LeftOut {
            pictures: 5,
            pairs: 4_000_000,
            for_good: true,
        };
        assert_eq!(budget.report(), Some(report), "all pictures");
    }
}
