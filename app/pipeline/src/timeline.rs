//! Which moment of the motion a picture shows.
//!
//! States come at the motion rate, each with its place on the time axis of motion; pictures are shown at times of the display.
//! What lies between, the *lag*, is measured rather than assumed: how old the newest state will be when the picture is shown
//! goes up and down like a saw, by one motion period, and its upper end is the lag at which there is always a newer state to
//! interpolate towards. A lag that changes does so slowly: time runs a little faster or slower, nothing jumps. Only a lag more
//! than a motion period too long, as a stall leaves it, is cut at once: states that old are not kept. And whatever pictures took
//! before, none shows a moment more than two motion periods before the newest state: a device that draws a picture a second shows motion
//! late by that picture, and not by its slowest ones of a minute ago.

use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Pictures from which the lag is estimated: 1.4 s at 90 Hz.
const WINDOW: usize = 128;
/// Of those so many percent find a newer state; the rest shows the newest for a moment longer.
const SERVED_PERCENT: usize = 95;
/// How far beyond the usual age the lag goes at most, in motion periods: states older than that are not kept, so that a stall
/// must not be made up for.
const KEPT: f64 = 1.5;
/// How far before the newest state a picture shows at most, in motion periods: one to have a newer state to go towards, one for states that come unevenly.
const BEHIND: f64 = 2.0;
/// The lag changes by no more than this share of the time that passes.
const SLEW: f64 = 0.1;
/// Until so many pictures the lag follows at once.
const ACQUIRING: usize = 16;
/// Two states further apart (seconds) do not belong to one motion: the older is taken to be this old.
const FURTHEST: f64 = 0.1;

/// After so many motion periods without a new state the person stands still, or frames are lost: ages say nothing about the lag.
const PAUSE: f64 = 2.0;

/// What is done about the time from one motion frame to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LatencyMode {
    /// Pictures lie between two states: exact, and one motion period late.
    #[default]
    Interpolate,
    /// Pictures go on from the newest state by up to one motion period: not late, and wrong where motion turns.
    Extrapolate,
    /// Pictures show the newest state as it is, whenever that was: for stills, which have no time.
    Newest,
}

/// How far beyond the newest state [`LatencyMode::Extrapolate`] goes, in motion periods.
const BOUND: f32 = 1.0;

/// How much later than it is due a moment of the motion is displayed, for whoever has to keep up with pictures: the [`Timeline`] tells,
/// anyone reads.
#[derive(Debug, Clone)]
pub struct DisplayLag(Arc<AtomicU64>);

impl DisplayLag {
    const UNKNOWN: u64 = u64::MAX;

    /// Of the last picture; `None` before the first.
    #[must_use]
    pub fn get(&self) -> Option<Duration> {
        let micros = self.0.load(Relaxed);
        (micros != Self::UNKNOWN).then(|| Duration::from_micros(micros))
    }

    fn tell(&self, lag: Duration) {
        let micros = u64::try_from(lag.as_micros()).unwrap_or(Self::UNKNOWN);
        self.0.store(micros, Relaxed);
    }
}

impl Default for DisplayLag {
    fn default() -> Self {
        Self(Arc::new(AtomicU64::new(Self::UNKNOWN)))
    }
}

/// Where on the time axis of motion pictures are.
#[derive(Debug, Clone)]
pub struct Timeline {
    mode: LatencyMode,
    /// Seconds that the newest state is old when a picture is shown, for the last pictures.
    ages: [f64; WINDOW],
    seen: usize,
    /// Seconds between motion frames.
    period: f64,
    /// Seconds between the last two states.
    apart: f64,
    lag: f64,
    /// The newest state, and when the first picture after it was displayed.
    newest: Option<(Instant, Instant)>,
    /// The last picture's time on the display and on the axis.
    last: Option<(Instant, Instant)>,
    told: DisplayLag,
}

impl Timeline {
    /// Without any lag yet; tells `told` of it from then on.
    #[must_use]
    pub fn new(mode: LatencyMode, told: DisplayLag) -> Self {
        Self {
            mode,
            told,
            ages: [0.0; WINDOW],
            seen: 0,
            period: 1.0 / 30.0,
            apart: 0.0,
            lag: 0.0,
            newest: None,
            last: None,
        }
    }

    /// Seconds between motion frames, as they come at present.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Takes note of the time between a state and the one before it.
    pub fn state_came(&mut self, before: Instant, due: Instant) {
        let apart = due.saturating_duration_since(before).as_secs_f64();
        self.apart = apart;
        if (0.004..FURTHEST).contains(&apart) {
            self.period += (apart - self.period) * 0.1;
        }
    }

    /// The moment of motion that a picture shows which is displayed at `displayed`, when the newest state is due at `newest`.
    pub fn moment(&mut self, displayed: Instant, newest: Instant) -> Instant {
        let since = match self.newest {
            Some((known, since)) if known == newest => since,
            _ => displayed,
        };
        self.newest = Some((newest, since));
        let waited = displayed.saturating_duration_since(since).as_secs_f64();
        let age = displayed.saturating_duration_since(newest).as_secs_f64();
        if waited < PAUSE * self.period || self.seen == 0 {
            self.ages[self.seen % WINDOW] = age;
            self.seen += 1;
        }
        let usual = self.age(50);
        let oldest = self.age(SERVED_PERCENT).min(usual + KEPT * self.period);
        let wanted = match self.mode {
            LatencyMode::Interpolate => oldest,
            LatencyMode::Extrapolate => (oldest - self.period).max(0.0),
            LatencyMode::Newest => 0.0,
        };
        let elapsed = self.last.map_or(0.0, |(last, _)| {
            displayed.saturating_duration_since(last).as_secs_f64()
        });
        if self.seen <= ACQUIRING {
            self.lag = self.lag.max(wanted);
        } else if self.lag > wanted + self.period {
            // Each picture would show the oldest state as it is, and the motion would go by jerks until the lag is reached.
            self.lag = wanted;
        } else {
            let most = elapsed * SLEW;
            self.lag += (wanted - self.lag).clamp(-most, most);
        }
        // Where states come more slowly than any motion is sent, as by slow networks, the next one is that far away, too.
        self.lag = self.lag.min(age + BEHIND * self.period.max(self.apart));
        let moment = displayed
            .checked_sub(Duration::from_secs_f64(self.lag))
            .unwrap_or(displayed);
        // Time never goes back, whatever the display says.
        let moment = self.last.map_or(moment, |(_, last)| moment.max(last));
        self.last = Some((displayed, moment));
        self.told.tell(displayed.saturating_duration_since(moment));
        moment
    }

    /// The age that so many percent of the last pictures do not exceed, in seconds.
    fn age(&self, percent: usize) -> f64 {
        let mut ages = self.ages;
        let ages = &mut ages[..self.seen.min(WINDOW)];
        let at = (ages.len() * percent).div_ceil(100).saturating_sub(1);
        *ages.select_nth_unstable_by(at, f64::total_cmp).1
    }

    /// The place of `moment` between two states: 0 at `from`, 1 at `to`; beyond 1 only where extrapolation is asked for, by
    /// no more than a motion period.
    #[must_use]
    pub fn alpha(&self, from: Instant, to: Instant, moment: Instant) -> f32 {
        let apart = to.saturating_duration_since(from).as_secs_f64();
        // After a pause the way from the old state to the new one takes no longer than that.
        let apart = apart.clamp(1e-4, FURTHEST);
        let before_end = to.saturating_duration_since(moment).as_secs_f64();
        let after_end = moment.saturating_duration_since(to).as_secs_f64();
        #[expect(clippy::cast_possible_truncation, reason = "a fraction")]
        let alpha = (1.0 + (after_end - before_end) / apart) as f32;
        match self.mode {
            LatencyMode::Interpolate => alpha.clamp(0.0, 1.0),
            LatencyMode::Extrapolate => alpha.clamp(0.0, 1.0 + BOUND),
            LatencyMode::Newest => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: Duration = Duration::from_micros(33_333);

    /// Shows motion at 30 Hz, each state ready `work` after it was due, asked for `lead` before it is displayed. Returns,
    /// once all has settled, how far behind the display each picture was, and its alpha.
    fn shown(mode: LatencyMode, hertz: u32, work: Duration, lead: Duration) -> Vec<(f64, f32)> {
        let start = Instant::now();
        let mut timeline = Timeline::new(mode, DisplayLag::default());
        let mut out = Vec::new();
        let mut newest = 0;
        for picture in 60..hertz * 20 {
            let displayed = start + Duration::from_secs(1) / hertz * picture;
            let asked = displayed - lead;
            while start + MOTION * (newest + 1) + work <= asked {
                newest += 1;
                timeline.state_came(start + MOTION * (newest - 1), start + MOTION * newest);
            }
            let moment = timeline.moment(displayed, start + MOTION * newest);
            let told = timeline.told.get().expect("there was a picture");
            assert!(
                told.abs_diff(displayed - moment) < Duration::from_micros(2),
                "{told:?}"
            );
            // The pair it lies in.
            let mut to = newest;
            while to > 1 && start + MOTION * (to - 1) > moment {
                to -= 1;
            }
            let alpha = timeline.alpha(start + MOTION * (to - 1), start + MOTION * to, moment);
            if picture > hertz * 10 {
                out.push(((displayed - moment).as_secs_f64() * 1e3, alpha));
            }
        }
        out
    }

    #[test]
    fn interpolation_is_one_motion_period_later_than_extrapolation_at_every_display_rate() {
        for hertz in [60, 72, 80, 90, 120] {
            let (work, lead) = (Duration::from_millis(25), Duration::from_millis(20));
            let interpolated = shown(LatencyMode::Interpolate, hertz, work, lead);
            let extrapolated = shown(LatencyMode::Extrapolate, hertz, work, lead);
            for ((late, alpha), (soon, beyond)) in interpolated.iter().zip(&extrapolated) {
                assert!(
                    (late - soon - 33.3).abs() < 1.0,
                    "{hertz} Hz: {late} {soon}"
                );
                assert!(
                    (60.0..80.0).contains(late),
                    "{hertz} Hz: 25 + 20 + up to 33 ms, {late}"
                );
                assert!((0.0..=1.0).contains(alpha), "{hertz} Hz: {alpha}");
                assert!((0.9..=2.0).contains(beyond), "{hertz} Hz: {beyond}");
            }
        }
    }

    /// States at 30 Hz, each ready `work` after it was due. `pictures` says how long each picture takes to draw, from when the one before is displayed, in order.
    /// Returns how far behind the display each picture is.
    fn behind(pictures: &[Duration], work: Duration) -> Vec<Duration> {
        let start = Instant::now();
        let mut timeline = Timeline::new(LatencyMode::Interpolate, DisplayLag::default());
        let (mut begun, mut newest) = (start + Duration::from_secs(1), 0);
        let mut out = Vec::new();
        for took in pictures {
            while start + MOTION * (newest + 1) + work <= begun {
                newest += 1;
                timeline.state_came(start + MOTION * (newest - 1), start + MOTION * newest);
            }
            let displayed = begun + *took;
            let moment = timeline.moment(displayed, start + MOTION * newest);
            out.push(displayed.saturating_duration_since(moment));
            begun = displayed;
        }
        out
    }

    #[test]
    fn what_pictures_took_before_makes_none_later_than_its_own_time_and_two_motion_periods() {
        let (work, fast) = (Duration::from_millis(5), Duration::from_millis(16));
        for slow in [1, 5, 10].map(|hertz| Duration::from_secs(1) / hertz) {
            // Slow for long, fast, and slow again: each time the first picture is as good as the last.
            let takes = [
                vec![slow; 60],
                vec![fast; 60],
                vec![slow; 60],
                vec![fast; 60],
            ]
            .concat();
            let found = behind(&takes, work);
            let last = takes.iter().zip(&found).enumerate();
            for (picture, (took, late)) in last {
                // The newest state is a motion period old at most when a picture is begun.
                let bound = *took + work + MOTION + MOTION * 2;
                assert!(
                    *late <= bound + Duration::from_millis(1),
                    "picture {picture}, which takes {took:?}, is {late:?} behind"
                );
            }
        }
    }

    #[test]
    fn motion_goes_on_evenly_whatever_the_display_rate() {
        for hertz in [60, 72, 90, 120] {
            let pictures = shown(
                LatencyMode::Interpolate,
                hertz,
                Duration::from_millis(18),
                Duration::from_millis(14),
            );
            let behind: Vec<f64> = pictures.iter().map(|(behind, _)| *behind).collect();
            let most = behind.iter().copied().fold(f64::MIN, f64::max);
            let least = behind.iter().copied().fold(f64::MAX, f64::min);
            assert!(most - least < 1.5, "{hertz} Hz: {least}..{most} ms behind");
        }
    }

    #[test]
    fn stills_show_the_newest_state_whenever_it_came() {
        for hertz in [10, 60] {
            let (work, lead) = (Duration::from_millis(25), Duration::from_millis(20));
            let stills = shown(LatencyMode::Newest, hertz, work, lead);
            assert!(
                stills
                    .iter()
                    .all(|(behind, alpha)| (*behind, *alpha) == (0.0, 1.0))
            );
        }
    }

    #[test]
    fn alpha_is_held_at_the_ends_and_a_pause_is_not_crept_over() {
        let at = |ms: u64| Instant::now() + Duration::from_millis(1_000_000 + ms);
        let start = at(0);
        let after = |ms: u64| start + Duration::from_millis(ms);
        let inside = Timeline::new(LatencyMode::Interpolate, DisplayLag::default());
        let beyond = Timeline::new(LatencyMode::Extrapolate, DisplayLag::default());
        assert!(
            (inside.alpha(after(0), after(30), after(15)) - 0.5).abs() < 1e-3,
            "half way"
        );
        assert_eq!(inside.alpha(after(0), after(30), after(60)), 1.0, "held");
        assert_eq!(
            beyond.alpha(after(0), after(30), after(60)),
            2.0,
            "one period on"
        );
        assert_eq!(
            beyond.alpha(after(0), after(30), after(600)),
            2.0,
            "and no further"
        );
        assert_eq!(
            inside.alpha(after(40), after(70), after(10)),
            0.0,
            "before both"
        );
        assert_eq!(
            inside.alpha(after(0), after(5000), after(4800)),
            0.0,
            "in a pause"
        );
        assert_eq!(
            inside.alpha(after(9), after(9), after(9)),
            1.0,
            "two at once"
        );
    }

    #[test]
    fn a_stall_at_the_start_does_not_hold_pictures_back_for_seconds() {
        let start = Instant::now() + Duration::from_secs(10);
        let mut timeline = Timeline::new(LatencyMode::Interpolate, DisplayLag::default());
        let mut behind = Vec::new();
        for picture in 0..90_u32 {
            let displayed = start + Duration::from_millis(11) * picture;
            // The first state is shown one second late, as where a unit compiles its program; those after it in time.
            let state = (picture * 11 / 33).saturating_sub(1);
            let newest = start + MOTION * state;
            let newest = if state == 0 {
                newest - Duration::from_secs(1)
            } else {
                newest
            };
            let moment = timeline.moment(displayed, newest);
            behind.push(displayed.duration_since(moment).as_millis());
        }
        assert!(behind[0] >= 1000, "{behind:?}");
        // Evenly, each is up to 66 ms behind; one motion period more is still among the states that are kept.
        let settled = &behind[30..];
        assert!(
            settled.iter().all(|behind| (60..100).contains(behind)),
            "{behind:?}"
        );
    }

    #[test]
    fn a_person_who_stood_still_for_a_minute_is_shown_no_later_than_before() {
        let start = Instant::now() + Duration::from_secs(10);
        let mut timeline = Timeline::new(LatencyMode::Interpolate, DisplayLag::default());
        let behind = |timeline: &mut Timeline, picture: u32, newest: Instant| {
            let displayed = start + Duration::from_millis(10) * picture;
            let moment = timeline.moment(displayed, newest);
            displayed.duration_since(moment).as_millis()
        };
        let state = |picture: u32| start + MOTION * (picture * 3 / 10) - Duration::from_millis(30);
        let mut before = 0;
        for picture in 0..300 {
            before = behind(&mut timeline, picture, state(picture));
        }
        for picture in 300..6300 {
            behind(&mut timeline, picture, state(299));
        }
        let mut after = 0;
        for picture in 6300..6350 {
            after = behind(&mut timeline, picture, state(picture));
        }
        assert!(
            after.abs_diff(before) <= 20,
            "{after} ms behind, {before} before"
        );
    }

    #[test]
    fn a_changed_lag_is_reached_slowly_and_time_never_goes_back() {
        let start = Instant::now() + Duration::from_secs(10);
        let mut timeline = Timeline::new(LatencyMode::Interpolate, DisplayLag::default());
        let period = Duration::from_millis(10);
        let mut last = None;
        for picture in 0..1000u32 {
            let displayed = start + period * picture;
            let age = Duration::from_millis(if picture < 300 { 60 } else { 90 });
            let moment = timeline.moment(displayed, displayed - age);
            if let Some(last) = last {
                let passed = moment.duration_since(last).as_secs_f64() * 1e3;
                if picture > 20 {
                    assert!((8.9..=11.1).contains(&passed), "{passed} ms in a picture");
                }
            }
            last = Some(moment);
        }
        let behind = (start + period * 999).duration_since(last.expect("pictures"));
        assert!((89..=91).contains(&behind.as_millis()), "{behind:?} behind");
    }
}
