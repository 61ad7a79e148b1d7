//! The path that a real headset's compositor takes: 72 frames a second into a window.

use test_support::headset_reference::numbers;
use test_support::load::{Load, Measured, judge};
use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

use crate::program::Program;

/// Milliseconds from one refresh of the display to the next.
const REFRESH_MS: f64 = 1e3 / 72.0;

/// How far a time is from a whole number of refreshes, and that number.
fn from_refreshes(ms: f64) -> (f64, f64) {
    let whole = (ms / REFRESH_MS).round();
    ((ms - whole * REFRESH_MS).abs(), whole)
}

/// The error of predicted times whose steps should be whole refreshes, if there is one.
fn wrong(steps: &[f64]) -> Option<String> {
    let regular = |step: &&f64| {
        let (off, whole) = from_refreshes(**step);
        off < 1.0 && whole >= 1.0
    };
    let whole = steps.iter().filter(regular).count();
    // Two clocks are read one after the other, and another process may run in between.
    println!("{whole} of {} steps are whole refreshes", steps.len());
    (whole * 10 < steps.len() * 8).then(|| format!("steps, ms: {steps:?}"))
}

#[test]
fn at_72_hz_predicted_times_rise_by_whole_refreshes() {
    attended(|| {
        judge(|| {
            // A new one each time: its display ends with its window.
            let monado = Monado::start(Driver::Simulated, Compositor::Window)?;
            let program = Program::start(&monado, 100, &[]);
            let load = Load::watch(monado.processes().into_iter().chain([program.id()]));
            let over = program.ended_well();
            let others = load.others();
            assert_eq!(over["shown"], 100, "frames shown");
            assert_eq!(over["rises"], true, "predicted times rise: {over}");
            // The compositor measures its display before it knows it.
            let periods = &numbers(&over["periods_ms"])[10..];
            for period in periods {
                let (off, whole) = from_refreshes(*period);
                assert!(off < 0.1 && whole >= 1.0, "a period of {period} ms");
            }
            let predicted = &numbers(&over["predicted_ms"])[10..];
            let steps: Vec<f64> = predicted.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let wrong = wrong(&steps);
            Some(Measured { wrong, others })
        });
    });
}
