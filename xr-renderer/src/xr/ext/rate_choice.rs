//! When a display can be asked for a higher rate, and when it has to go back. Pure: it calls nothing.
//!
//! A rate is gone up to after it was held with room for a while; it is gone back from when frames are missed, and then not
//! tried again for a time that doubles with each failure, so that a scene at the edge does not flicker between two rates.

/// Frames must have been in time with room for this long before the next rate is tried, seconds.
const HELD_S: f64 = 5.0;

/// The share of the next rate's period that a frame may take.
const ROOM: f32 = 0.8;

/// So many missed frames within [`MISSED_S`] are too many; one alone may be another program's fault.
const MISSED: usize = 3;

/// See [`MISSED`], seconds.
const MISSED_S: f64 = 1.0;

/// How long the next rate is not tried after the first failure, seconds.
const SHY_S: f64 = 20.0;

/// The longest that it is not tried, seconds.
const SHYEST_S: f64 = 320.0;

/// How one frame went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// When it is displayed, seconds of the runtime's clock.
    pub display_s: f64,
    /// Whether it was there for its time: nothing older was shown in its place.
    pub in_time: bool,
    /// What CPU and GPU took for it, one after the other, milliseconds.
    pub busy_ms: f32,
}

/// The rates there are, the one there is, and how it goes.
#[derive(Debug, Clone)]
pub(super) struct RateChoice {
    /// Rising, Hz. Never empty.
    rates: Vec<f32>,
    /// The rate that was asked for: below it is not gone.
    lowest: usize,
    now: usize,
    /// Since when every frame had room, seconds.
    since: Option<f64>,
    /// When frames were missed of late, seconds.
    missed: Vec<f64>,
    /// Before this nothing higher is tried, seconds.
    shy_until: f64,
    shy_s: f64,
}

impl RateChoice {
    /// Of these rates, the one nearest to the wanted. None where there are none.
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
            shy_until: f64::NEG_INFINITY,
            shy_s: SHY_S,
        })
    }

    pub(super) fn rates(&self) -> &[f32] {
        &self.rates
    }

    pub(super) fn now_hz(&self) -> f32 {
        self.rates[self.now]
    }

    /// The rate is this now, whoever changed it.
    pub(super) fn is(&mut self, hz: f32) {
        if let Some(now) = nearest(&self.rates, hz)
            && now != self.now
        {
            self.now = now;
            self.start_over();
        }
    }

    /// Takes a frame, and tells the rate to ask for, if another.
    pub(super) fn consider(&mut self, frame: &Held) -> Option<f32> {
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
        if at - since < HELD_S || at < self.shy_until {
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
        self.shy_until = at + self.shy_s;
        self.shy_s = (2.0 * self.shy_s).min(SHYEST_S);
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
