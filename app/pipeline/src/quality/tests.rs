//! The controller against simulated GPUs and displays, which share nothing with its own prediction but the ladder.

use super::recent::Recent;
use super::{
    KEPT_SHARES, LADDER, MOST_CHANGES_A_MINUTE, PictureCost, Quality, QualityController,
    QualityFigures, QualityMode,
};
use proptest::prelude::*;
use std::collections::VecDeque;
use std::time::Duration;

const PERIOD: Duration = Duration::from_nanos(11_111_111);
const PERIOD_MS: f64 = 11.111_111;

/// A GPU whose costs at full quality are told second by second, in display periods.
struct Simulation {
    hold: QualityController,
    seconds: f64,
    /// Quality answers of pictures still in flight: the display is told two pictures late.
    in_flight: VecDeque<usize>,
    random: fastrand::Rng,
    /// Relative standard deviation of a picture's time.
    noise: f64,
    /// Part of the raster that does not shrink with the pixels.
    stiff: f64,
    /// Time, load and step of every picture.
    trace: Vec<(f64, f64, usize)>,
}

impl Simulation {
    fn new() -> Self {
        Self {
            hold: QualityController::new(PERIOD, QualityMode::Adapt),
            seconds: 0.0,
            in_flight: VecDeque::new(),
            random: fastrand::Rng::with_seed(7),
            noise: 0.0,
            stiff: 0.0,
            trace: Vec::new(),
        }
    }

    /// Draws pictures for `seconds`; `load` tells raster, per-Gaussian work and sort at full quality for a time.
    fn run(&mut self, seconds: f64, load: impl Fn(f64, usize) -> [f64; 3]) {
        let end = self.seconds + seconds;
        let mut picture = 0u32;
        while self.seconds < end {
            self.in_flight.push_back(self.hold.quality().step);
            if self.in_flight.len() < 3 {
                continue;
            }
            let step = self.in_flight.pop_front().unwrap_or(0);
            let quality = LADDER[step];
            let pixels = f64::from(quality.resolution_scale).powi(2);
            let kept = f64::from(KEPT_SHARES[quality.level]);
            let [raster, gaussians, sort] = load(self.seconds, step);
            let wobble = (1.0
                + self.noise
                    * (self.random.f64() + self.random.f64() + self.random.f64() - 1.5)
                    * 2.0)
                .max(0.1);
            picture += 1;
            let sorts = picture.is_multiple_of(quality.sort_every);
            let cost = PictureCost {
                step,
                pixels_ms: raster * (self.stiff + (1.0 - self.stiff) * pixels) * wobble * PERIOD_MS,
                gaussians_ms: gaussians * kept * wobble * PERIOD_MS,
                sort_ms: if sorts {
                    sort * kept * wobble * PERIOD_MS
                } else {
                    0.0
                },
                fixed_ms: 0.0,
                late_periods: 0,
            };
            let took = cost.total_ms() / PERIOD_MS;
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "few periods"
            )]
            let late = (took.ceil() - 1.0).max(0.0) as u32;
            self.trace.push((self.seconds, took, step));
            self.hold.picture(&PictureCost {
                late_periods: late,
                ..cost
            });
            self.seconds += (1.0 + f64::from(late)) * PERIOD_MS / 1e3;
        }
    }

    fn step(&self) -> usize {
        self.hold.quality().step
    }

    fn figures(&self) -> QualityFigures {
        self.hold.figures()
    }
}

/// A load that is half raster, a third per-Gaussian work, the rest the sort.
fn mixed(periods: f64) -> [f64; 3] {
    [0.5 * periods, 0.33 * periods, 0.17 * periods]
}

#[test]
fn a_light_load_keeps_full_quality() {
    let mut simulation = Simulation::new();
    simulation.noise = 0.1;
    simulation.run(60.0, |_, _| mixed(0.7));
    let figures = simulation.figures();
    assert_eq!(
        (simulation.step(), figures.change_count),
        (0, 0),
        "{figures:?}"
    );
    assert_eq!(figures.missed_periods, 0, "{figures:?}");
}

#[test]
fn a_constant_overload_ends_at_the_first_step_that_holds_after_few_misses() {
    for load in [1.1, 1.25, 1.6, 2.1, 4.0] {
        let mut simulation = Simulation::new();
        simulation.noise = 0.03;
        simulation.run(120.0, |_, _| mixed(load));
        let figures = simulation.figures();
        let step = simulation.step();
        let takes = |step: usize| {
            let [raster, gaussians, sort] = mixed(load);
            let quality = LADDER[step];
            let kept = f64::from(KEPT_SHARES[quality.level]);
            raster * f64::from(quality.resolution_scale).powi(2) + (gaussians + sort) * kept
        };
        assert!(
            figures.change_count <= 3,
            "load {load}: {:?}",
            figures.changes
        );
        if takes(6) < 0.85 {
            assert!(takes(step) <= 0.9, "load {load}: step {step} does not hold");
            // The step before may be too close to the limit to be tried; that before it must not hold with ease.
            let eased = step
                .checked_sub(2)
                .is_some_and(|better| takes(better) < 0.8);
            assert!(!eased, "load {load}: no need for step {step}");
            assert!(
                figures.missed_periods <= 16,
                "load {load}: {} missed",
                figures.missed_periods
            );
        } else {
            assert_eq!(step, LADDER.len() - 1, "load {load}: nothing holds");
            assert!(
                figures.overloaded_at_last_step > 1_000,
                "load {load} is told"
            );
        }
    }
}

#[test]
fn a_raster_that_hardly_follows_the_pixels_still_ends_at_a_step_that_holds() {
    let mut simulation = Simulation::new();
    simulation.stiff = 0.6;
    simulation.run(60.0, |_, _| [1.0, 0.2, 0.05]);
    let figures = simulation.figures();
    assert!(figures.missed_periods < 20, "{figures:?}");
    assert!(figures.change_count <= 5, "{:?}", figures.changes);
    let before = figures.missed_periods;
    simulation.run(60.0, |_, _| [1.0, 0.2, 0.05]);
    assert_eq!(
        simulation.figures().missed_periods,
        before,
        "it holds from then on"
    );
    simulation.run(120.0, |_, _| [0.4, 0.1, 0.05]);
    assert_eq!(
        simulation.step(),
        0,
        "and comes back: {:?}",
        simulation.figures().changes
    );
}

#[test]
fn one_long_picture_changes_nothing() {
    let mut simulation = Simulation::new();
    simulation.run(30.0, |t, _| {
        mixed(if (10.005..10.016).contains(&t) {
            5.0
        } else {
            0.7
        })
    });
    let figures = simulation.figures();
    assert_eq!(figures.change_count, 0, "{:?}", figures.changes);
    assert_eq!(
        (figures.late_pictures, figures.missed_periods),
        (1, 4),
        "but it is counted"
    );
}

#[test]
fn one_slow_picture_a_second_neither_lowers_quality_nor_keeps_it_low() {
    let mut simulation = Simulation::new();
    simulation.run(3.0, |_, _| mixed(1.4));
    assert!(simulation.step() > 0, "it fell");
    simulation.run(60.0, |t, _| {
        mixed(if t.fract() < 0.011 { 2.0 } else { 0.5 })
    });
    assert_eq!(simulation.step(), 0, "{:?}", simulation.figures().changes);
}

#[test]
fn a_slow_heat_up_walks_down_and_the_cool_down_all_the_way_back() {
    let mut simulation = Simulation::new();
    simulation.noise = 0.05;
    let load = |t: f64| 0.7 + 1.1 * (1.0 - ((t - 150.0) / 150.0).abs()).max(0.0);
    simulation.run(150.0, |t, _| mixed(load(t)));
    let hot = simulation.figures();
    assert!(simulation.step() >= 4, "at the hottest: {:?}", hot.changes);
    assert!(hot.change_count <= 12, "{:?}", hot.changes);
    let share = hot.missed_periods as f64 / hot.pictures as f64;
    assert!(share < 0.01, "{share} of the periods missed");
    simulation.run(200.0, |t, _| mixed(load(t)));
    let cool = simulation.figures();
    assert_eq!(simulation.step(), 0, "cool again: {:?}", cool.changes);
    assert!(cool.change_count <= 24, "{:?}", cool.changes);
    dump("heat", &simulation);
}

#[test]
fn noise_about_the_limit_settles() {
    for (noise, most) in [(0.1, 8), (0.25, 40)] {
        let mut simulation = Simulation::new();
        simulation.noise = noise;
        simulation.run(300.0, |_, _| mixed(0.9));
        let figures = simulation.figures();
        println!("noise {noise}: {} changes", figures.change_count);
        assert!(
            figures.change_count <= most,
            "noise {noise}: {} changes in five minutes: {:?}",
            figures.change_count,
            figures.changes
        );
        assert!(
            (1..=5).contains(&simulation.step()),
            "noise {noise}: {:?}",
            figures.changes
        );
    }
}

/// Work that a better step wakes and a worse one stills: what makes naive controllers swing.
#[test]
fn a_load_that_flips_whenever_quality_rises_is_left_alone_more_and_more() {
    let mut simulation = Simulation::new();
    simulation.run(1.0, |_, _| mixed(1.3));
    let low = simulation.step();
    assert!(low > 0, "it fell");
    // As it predicts that the better step holds, it climbs; there, the load is another.
    simulation.run(600.0, |_, step| mixed(if step < low { 1.6 } else { 0.6 }));
    let figures = simulation.figures();
    let late: Vec<_> = figures
        .changes
        .iter()
        .filter(|c| c.at_seconds > 300.0)
        .collect();
    assert!(
        late.len() <= 18,
        "at most one attempt (two climbs, one fall) in 50 s: {late:?}"
    );
    let share = figures.missed_periods as f64 / figures.pictures as f64;
    assert!(share < 0.005, "{share} of the periods missed");
    dump("flip", &simulation);
    simulation.run(240.0, |_, _| mixed(0.5));
    assert_eq!(
        simulation.step(),
        0,
        "all the way back: {:?}",
        simulation.figures().changes
    );
}

#[test]
fn a_load_that_flips_as_fast_as_the_controller_answers_does_not_make_it_swing() {
    for half_period in [0.05, 0.2, 1.0, 2.2, 4.5, 9.0, 20.0] {
        let mut simulation = Simulation::new();
        let heavy = |t: f64| (t / half_period).rem_euclid(2.0) < 1.0;
        simulation.run(600.0, |t, _| mixed(if heavy(t) { 1.5 } else { 0.3 }));
        let figures = simulation.figures();
        assert!(
            figures.change_count <= 60,
            "{half_period} s: {} changes in ten minutes: {:?}",
            figures.change_count,
            figures.changes
        );
        let share = figures.missed_periods as f64 / figures.pictures as f64;
        assert!(
            share < 0.01,
            "{half_period} s: {share} of the periods missed"
        );
    }
}

#[test]
fn misses_that_are_not_the_gpu_s_are_counted_and_lower_nothing() {
    let mut hold = QualityController::new(PERIOD, QualityMode::Adapt);
    for _ in 0..1_000 {
        let cost = PictureCost {
            pixels_ms: 3.0,
            gaussians_ms: 2.0,
            late_periods: 1,
            ..PictureCost::default()
        };
        assert_eq!(hold.picture(&cost).step, 0, "less work would not help");
    }
    let figures = hold.figures();
    assert_eq!(
        (figures.missed_periods, figures.missed_elsewhere),
        (1_000, 1_000),
        "counted"
    );
}

#[test]
fn without_a_clock_misses_alone_lower_quality_and_calm_raises_it() {
    let mut hold = QualityController::new(PERIOD, QualityMode::Adapt);
    let picture = |hold: &mut QualityController, late_periods: u32| {
        let step = hold.quality().step;
        hold.picture(&PictureCost {
            step,
            late_periods,
            ..PictureCost::default()
        })
    };
    for _ in 0..12 {
        picture(&mut hold, 1);
    }
    assert_eq!(hold.quality().step, 3, "one step for every four misses");
    for _ in 0..90 * 60 {
        picture(&mut hold, 0);
    }
    assert_eq!(hold.quality().step, 0, "calm for a minute");
}

#[test]
fn a_fixed_quality_stays_and_counts() {
    let mut hold = QualityController::new(PERIOD, QualityMode::Fixed(4));
    for _ in 0..500 {
        let cost = PictureCost {
            step: 4,
            pixels_ms: 30.0,
            late_periods: 2,
            ..PictureCost::default()
        };
        assert_eq!(hold.picture(&cost), LADDER[4], "fixed");
    }
    hold.repeated();
    let figures = hold.figures();
    assert_eq!(
        (
            figures.late_pictures,
            figures.missed_periods,
            figures.repeated_periods
        ),
        (500, 1_000, 1),
        "counts"
    );
    assert_eq!(figures.steps[4].pictures, 500, "by step");
    let seconds = 1_501.0 * PERIOD_MS / 1e3;
    assert!(
        (figures.steps[4].seconds - seconds).abs() < 1e-3,
        "{:?}",
        figures.steps[4]
    );
    serde_json::to_string(&figures).expect("figures are JSON");
}

#[test]
fn the_ladder_gives_up_resolution_first_then_gaussians_then_the_sort() {
    for pair in LADDER.windows(2) {
        let key = |q: &Quality| (q.sort_every, q.level, -q.resolution_scale);
        let (a, b) = (key(&pair[0]), key(&pair[1]));
        let changed = [a.0 != b.0, a.1 != b.1, a.2 != b.2];
        assert_eq!(
            changed.iter().filter(|c| **c).count(),
            1,
            "one thing at a time: {a:?} {b:?}"
        );
        assert!(a < b, "only ever less: {a:?} {b:?}");
    }
}

/// Counts the changes of any minute.
fn most_in_a_minute(times: &[f64]) -> usize {
    let within = |start: f64| {
        times
            .iter()
            .filter(|t| (start..start + 60.0).contains(*t))
            .count()
    };
    times.iter().map(|t| within(*t)).max().unwrap_or(0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the times, also when they answer the steps; and when the load has gone, quality is back.
    #[test]
    fn it_never_changes_more_often_than_it_says_and_always_comes_back(
        phases in prop::collection::vec((0.0f64..3.0, 1usize..900, 0.0f64..1.0, 0usize..9), 1..60),
        seed in any::<u64>(),
    ) {
        let mut hold = QualityController::new(PERIOD, QualityMode::Adapt);
        let mut random = fastrand::Rng::with_seed(seed);
        let mut times = Vec::new();
        let mut periods = 0.0;
        let mut picture = |hold: &mut QualityController, load: f64, late: u32| {
            let step = hold.quality().step;
            periods += 1.0 + f64::from(late);
            let pixels_ms = load * PERIOD_MS;
            let cost = PictureCost { step, pixels_ms, late_periods: late, ..PictureCost::default() };
            if hold.picture(&cost).step != step {
                times.push(periods * PERIOD_MS / 1e3);
            }
        };
        for (load, pictures, noise, woken_above) in phases {
            for _ in 0..pictures {
                // Some phases are heavy only at good steps: an adversary that watches.
                let woken = if hold.quality().step < woken_above { 1.0 } else { 0.2 };
                let load = load * woken * (1.0 + noise * (random.f64() - 0.5));
                let late = u32::from(load > 1.0);
                picture(&mut hold, load, late);
            }
        }
        for _ in 0..90 * 60 * 4 {
            picture(&mut hold, 0.2, 0);
        }
        prop_assert_eq!(hold.quality().step, 0, "all the way back");
        prop_assert!(most_in_a_minute(&times) <= MOST_CHANGES_A_MINUTE, "{:?}", times);
    }
}

/// The trace as CSV where `MON3TR_HOLD_TRACES` names a folder, for who wants to plot it.
fn dump(name: &str, simulation: &Simulation) {
    if let Some(folder) = std::env::var_os("MON3TR_HOLD_TRACES") {
        let lines: String = simulation
            .trace
            .iter()
            .map(|(t, load, step)| format!("{t:.3},{load:.3},{step}\n"))
            .collect();
        let file = std::path::Path::new(&folder).join(format!("{name}.csv"));
        std::fs::write(file, lines).expect("the trace is written");
    }
}

#[test]
fn it_begins_where_an_expected_picture_fits() {
    let expecting = |periods: f64, mode| {
        let picture = PERIOD.mul_f64(periods);
        let begun = QualityController::new(PERIOD, mode).expecting(Some(picture));
        begun.quality().step
    };
    // Nothing is known, or it fits.
    assert_eq!(expecting(0.0, QualityMode::Adapt), 0);
    assert_eq!(expecting(0.84, QualityMode::Adapt), 0);
    // At 85 % of width and height 72 % of the pixels: by hand, 1 - 0.85 x 0.28 = 0.76 of the time.
    assert_eq!(expecting(1.1, QualityMode::Adapt), 1);
    // At 70 %, 0.57 of it, at 60 %, 0.46.
    assert_eq!(expecting(1.45, QualityMode::Adapt), 2);
    assert_eq!(expecting(1.8, QualityMode::Adapt), 3);
    assert_eq!(expecting(50.0, QualityMode::Adapt), LADDER.len() - 1);
    // What is asked for stays.
    assert_eq!(expecting(50.0, QualityMode::Fixed(2)), 2);
}

#[test]
fn what_no_quality_shortens_is_predicted_as_it_is() {
    let mut costs = Recent::new();
    costs.push(PictureCost {
        pixels_ms: 4.0,
        gaussians_ms: 2.0,
        sort_ms: 1.0,
        fixed_ms: 3.0,
        ..PictureCost::default()
    });
    let (best, last) = (Quality::of_step(0), Quality::of_step(LADDER.len() - 1));
    let at_best = costs.predicted(best, best, 1, 100);
    assert!((at_best - 10.0).abs() < 1e-9, "{at_best}");
    // 60 % of width and height, 35 % of the Gaussians, every other picture sorted.
    let at_last = costs.predicted(best, last, 1, 100);
    let scaled = at_last - 3.0;
    assert!((1.5..3.5).contains(&scaled), "{at_last}");
}
