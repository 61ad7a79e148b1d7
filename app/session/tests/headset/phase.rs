//! The moment of motion that a picture shows goes with the time at which the runtime says it will be seen.

use crate::program::Shown;
use crate::run::{Run, turn};
use test_support::load::{Measured, judge};
use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

/// How long it is looked at, seconds; what comes before the lag is known is not.
const SECONDS: f64 = 12.0;
const WARM_MS: f64 = 4e3;

/// Steps that tell anything: on a machine that stands still now and then there are fewer than the pictures of eight seconds.
const FEWEST: usize = 20;

/// From one picture to the next, milliseconds.
#[derive(Debug)]
struct Step {
    predicted: f64,
    moment: f64,
}

impl Step {
    /// Whether the moment went on as the display did, but for so much and for the tenth by which the lag may change meanwhile.
    fn is_followed(&self, within: f64) -> bool {
        (self.moment - self.predicted).abs() <= within + 0.1 * self.predicted
    }
}

/// The regular steps: as long as the one before, so that they were to be foreseen; from and to pictures whose Gaussians were made for
/// them, which lie between two states, and not at the newest one because there was none newer.
fn regular(shown: &[Shown]) -> Vec<Step> {
    let Some(first) = shown.first() else {
        return Vec::new();
    };
    let threes = shown.windows(3).filter_map(|three| match three {
        [before, one, next] if before.predicted > first.predicted + WARM_MS => {
            let fresh = before.fresh && one.fresh && next.fresh;
            let between = 0.0 < next.alpha && next.alpha < 1.0;
            let (last, now) = (
                one.predicted - before.predicted,
                next.predicted - one.predicted,
            );
            let even = (now - last).abs() < 1.0;
            (fresh && between && even).then_some(Step {
                predicted: now,
                moment: next.moment - one.moment,
            })
        }
        _ => None,
    });
    threes.collect()
}

/// What is wrong with these steps on a display that is refreshed every so many milliseconds, if anything is.
fn wrong(steps: &[Step], refresh: f64) -> Option<String> {
    let count = |within: f64| steps.iter().filter(|step| step.is_followed(within)).count();
    let (near, close) = (count(refresh), count(2.0));
    println!(
        "of {} regular steps {near} are followed to a refresh, {close} to 2 ms",
        steps.len()
    );
    let wrong = if steps.len() < FEWEST {
        "regular steps"
    } else if near * 100 < steps.len() * 95 {
        // Not every frame that the runtime leaves out is to be foreseen.
        "to a refresh"
    } else if close * 100 < steps.len() * 70 {
        "to 2 ms"
    } else {
        return None;
    };
    Some(format!("{wrong}: {near} and {close} of {steps:?}"))
}

/// That moments go as predicted times do, on a display that is refreshed every so many milliseconds.
fn assert_in_phase(compositor: Compositor, refresh: f64) {
    let mut steps = Vec::new();
    judge(|| {
        // A new one each time: its display ends with its window.
        let monado = Monado::start(Driver::Simulated, compositor)?;
        let report = Run::start(&monado, SECONDS).report();
        let rises = |pair: &[Shown]| {
            pair[1].predicted > pair[0].predicted && pair[1].moment >= pair[0].moment
        };
        assert!(
            report.shown.windows(2).all(rises),
            "time goes back: {:?}",
            report.shown
        );
        println!("{} pictures", report.shown.len());
        steps.extend(regular(&report.shown));
        let wrong = wrong(&steps, refresh);
        // A busy machine has few regular steps: then the next run's count with them.
        if steps.len() >= FEWEST {
            steps.clear();
        }
        Some(Measured {
            wrong,
            others: report.others,
        })
    });
}

#[test]
fn at_20_hz_moments_of_motion_follow_the_predicted_times() {
    let Some(_alone) = turn() else { return };
    attended(|| assert_in_phase(Compositor::Null, 50.0));
}

#[test]
fn at_72_hz_moments_of_motion_follow_the_predicted_times() {
    let Some(_alone) = turn() else { return };
    attended(|| assert_in_phase(Compositor::Window, 1e3 / 72.0));
}
