//! When to ask a display for a higher rate, and when to go back. Pure: it makes no OpenXR calls.
//!
//! The rate rises after the present one was held with room for a while; it falls when frames are missed, and the higher one is then not
//! tried again for a time that doubles with each failure, so that a scene at the edge does not flicker between two rates.

/// Frames must have been in time with room for this long before the next rate is tried, seconds.
const HELD_S: f64 = 5.0;

/// The share of the next rate's period that a frame may take.
const ROOM: f32 = 0.8;

/// The missed frames within [`MISSED_S`] that lower the rate; a single one may be another program's fault.
const MISSED: usize = 3;

/// See [`MISSED`], seconds.
const MISSED_S: f64 = 1.0;

/// How long the next rate is not tried after the first failure, seconds.
const BACKOFF_S: f64 = 20.0;

/// The longest that it is not tried, seconds.
const BACKOFF_MOST_S: f64 = 320.0;

/// How one frame went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameTiming {
    /// When it is displayed, seconds of the runtime's clock.
    pub display_s: f64,
    /// Whether it was in time: no older frame was shown in its place.
    pub in_time: bool,
    /// What CPU and GPU took for it, one after the other, milliseconds.
    pub busy_ms: f32,
}

/// The display's rates, the present one, and how frames kept up with it.
#[derive(Debug, Clone)]
pub(super) struct RateChoice {
    /// Rising, Hz. Never empty.
    rates: Vec<f32>,
    /// The rate that was asked for, and the lowest that is chosen.
    lowest: usize,
    now: usize,
    /// Since when every frame had room, seconds.
    since: Option<f64>,
    /// When frames were missed recently, seconds.
    missed: Vec<f64>,
    /// No higher rate is tried before this, seconds.
    backoff_until: f64,
    backoff_s: f64,
}

impl RateChoice {
    /// Starts from the rate nearest to the wanted one. None where there are no rates.
    pub(super) fn new(rates: &[f32], wanted_hz: f32) -> Option<Self> {
        let mut rates: Vec<f32> = rates
            .iter()
            .copied()
            .filter(|rate| rate.is_finite() && *rate > 0.0)
            .collect();
        rates.sort_by(f32::total_cmp);
        rates.dedup();
        let lowest = nearest(&rates, wanted_hz)?;
        Some(Self {
            rates,
            lowest,
            now: lowest,
            since: None,
            missed: Vec::new(),
            backoff_until: f64::NEG_INFINITY,
            backoff_s: BACKOFF_S,
        })
    }

    pub(super) fn rates(&self) -> &[f32] {
        &self.rates
    }

    pub(super) fn now_hz(&self) -> f32 {
        self.rates[self.now]
    }

    /// Takes note of the present rate, which the runtime may have changed by itself.
    pub(super) fn is(&mut self, hz: f32) {
        if let Some(now) = nearest(&self.rates, hz)
            && now != self.now
        {
            self.now = now;
            self.start_over();
        }
    }

    /// Keeps the present rate.
    pub(super) fn stay(&mut self) {
        let now = self.now_hz();
        self.rates = vec![now];
        (self.lowest, self.now) = (0, 0);
        self.start_over();
    }

    /// Takes a frame, and returns the rate to ask for, if it changes.
    pub(super) fn consider(&mut self, frame: &FrameTiming) -> Option<f32> {
        let at = frame.display_s;
        if frame.in_time {
            self.rise(at, frame.busy_ms)
        } else {
            self.fall(at)
        }
    }

    /// The runtime refuses this rate: it is not asked for again.
    pub(super) fn refuse(&mut self, hz: f32) {
        if let Some(place) = self.rates.iter().position(|rate| *rate == hz)
            && self.rates.len() > 1
            && place > self.lowest
        {
            self.rates.truncate(place);
            self.now = self.now.min(place - 1);
            self.start_over();
        }
    }

    fn rise(&mut self, at: f64, busy_ms: f32) -> Option<f32> {
        let next = *self.rates.get(self.now + 1)?;
        if busy_ms > ROOM * 1000.0 / next {
            self.since = None;
            return None;
        }
        let since = *self.since.get_or_insert(at);
        if at - since < HELD_S || at < self.backoff_until {
            return None;
        }
        self.now += 1;
        self.start_over();
        Some(next)
    }

    fn fall(&mut self, at: f64) -> Option<f32> {
        self.since = None;
        self.missed.retain(|when| at - when < MISSED_S);
        self.missed.push(at);
        if self.missed.len() < MISSED || self.now <= self.lowest {
            return None;
        }
        self.now -= 1;
        self.backoff_until = at + self.backoff_s;
        self.backoff_s = (2.0 * self.backoff_s).min(BACKOFF_MOST_S);
        self.start_over();
        Some(self.now_hz())
    }

    fn start_over(&mut self) {
        self.since = None;
        self.missed.clear();
    }
}

fn nearest(rates: &[f32], hz: f32) -> Option<usize> {
    let off = |place: &usize| (rates[*place] - hz).abs();
    (0..rates.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: [f32; 0] = [];

    const RATES: [f32; 4] = [60.0, 72.0, 90.0, 120.0];

    /// Frames at the rate there is, for so many seconds; the rates that were asked for.
    fn frames(
        choice: &mut RateChoice,
        from_s: f64,
        seconds: f64,
        in_time: impl Fn(usize) -> bool,
        busy_ms: f32,
    ) -> Vec<f32> {
        let mut asked = Vec::new();
        let mut at = from_s;
        let mut count = 0;
        while at < from_s + seconds {
            let frame = FrameTiming {
                display_s: at,
                in_time: in_time(count),
                busy_ms,
            };
            asked.extend(choice.consider(&frame));
            at += 1.0 / f64::from(choice.now_hz());
            count += 1;
        }
        asked
    }

    #[test]
    fn it_starts_with_the_rate_nearest_to_the_requested_one() {
        let at = |wanted| RateChoice::new(&RATES, wanted).map(|choice| choice.now_hz());
        assert_eq!(at(72.0), Some(72.0), "the wanted");
        assert_eq!(at(80.0), Some(72.0), "below it");
        assert_eq!(at(500.0), Some(120.0), "the highest");
        let none = RateChoice::new(&[f32::NAN, 0.0], 72.0);
        assert!(none.is_none(), "rates that are none");
    }

    #[test]
    fn frames_with_room_raise_the_rate_step_by_step() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        // 6 ms are less than 0.8 of 1/120 s.
        assert_eq!(
            frames(&mut choice, 0.0, 4.9, |_| true, 6.0),
            NONE,
            "not yet held"
        );
        assert_eq!(
            frames(&mut choice, 5.0, 0.2, |_| true, 6.0),
            [90.0],
            "one step"
        );
        assert_eq!(
            frames(&mut choice, 5.2, 60.0, |_| true, 6.0),
            [120.0],
            "and the last"
        );
    }

    #[test]
    fn without_room_for_the_next_rate_it_stays() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        // 0.8 of 1/90 s is 8.9 ms.
        assert_eq!(
            frames(&mut choice, 0.0, 60.0, |_| true, 9.0),
            NONE,
            "too slow"
        );
        assert_eq!(
            frames(&mut choice, 60.0, 60.0, |_| true, 8.8),
            [90.0],
            "for 90, not for 120"
        );
    }

    #[test]
    fn one_missed_frame_restarts_the_wait_and_keeps_the_rate() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        frames(&mut choice, 0.0, 4.0, |_| true, 6.0);
        frames(&mut choice, 4.0, 0.01, |_| false, 6.0);
        assert_eq!(
            frames(&mut choice, 4.1, 4.9, |_| true, 6.0),
            NONE,
            "waits anew"
        );
        assert_eq!(choice.now_hz(), 72.0, "no step down");
    }

    #[test]
    fn missed_frames_lower_the_rate_and_the_backoff_grows_each_time() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        let mut at = 0.0;
        let mut shunned = Vec::new();
        for _ in 0..6 {
            // Up to 90 ...
            let start = at;
            while choice.now_hz() < 90.0 {
                frames(&mut choice, at, 0.1, |_| true, 8.0);
                at += 0.1;
            }
            shunned.push(at - start);
            // ... where every tenth frame is missed.
            while choice.now_hz() > 72.0 {
                frames(&mut choice, at, 0.1, |count| count % 10 != 0, 8.0);
                at += 0.1;
            }
        }
        for (times, pair) in shunned[1..].windows(2).enumerate() {
            let longest = pair[1] > 319.0;
            assert!(longest || pair[1] > 1.9 * pair[0], "{times}: {shunned:?}");
        }
        assert!(shunned.iter().all(|wait| *wait < 326.0), "{shunned:?}");
    }

    #[test]
    fn it_never_goes_below_the_requested_rate() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        assert_eq!(
            frames(&mut choice, 0.0, 30.0, |_| false, 30.0),
            NONE,
            "down"
        );
        assert_eq!(choice.now_hz(), 72.0, "where it was");
    }

    #[test]
    fn it_continues_from_a_rate_that_the_runtime_sets_by_itself() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        choice.is(60.0);
        assert_eq!(choice.now_hz(), 60.0, "hot");
        assert_eq!(
            frames(&mut choice, 0.0, 6.0, |_| true, 6.0),
            [72.0],
            "back up"
        );
    }

    #[test]
    fn a_rate_that_is_refused_is_not_asked_for_again() {
        let mut choice = RateChoice::new(&RATES, 72.0).expect("rates");
        assert_eq!(
            frames(&mut choice, 0.0, 5.1, |_| true, 6.0),
            [90.0],
            "asked"
        );
        choice.is(72.0);
        choice.refuse(90.0);
        assert_eq!(
            frames(&mut choice, 6.0, 600.0, |_| true, 6.0),
            NONE,
            "again"
        );
        assert_eq!(choice.rates(), [60.0, 72.0], "what is left");
    }
}
