//! Time in a headset takes no memory: not this machine's, not the device's.

use crate::program::Holdings;
use crate::run::{Report, Run, turn};
use glam::Quat;
use std::time::{Duration, Instant};
use test_support::monado::{Compositor, Driver, Head, Monado, Pose, Scripted};
use test_support::service::attended;

/// How long the puppet dances, seconds; and after which of them everything has been made that there will be.
const DANCE: f64 = 36.0;
const WARM: f64 = 12.0;

/// The fewest frames that tell anything.
const FEWEST: u64 = 300;

/// By how much the end may be above the middle, bytes: what is resident grows into what was set aside at the start (the spans and
/// pictures of the last minutes are kept), and what is allocated by the predicted times of frames.
const MOST_RESIDENT: f64 = 6e6;
const MOST_ALLOCATED: f64 = 64e3;

/// The largest of a figure within a part of the time after the warm-up.
fn most(of: &[Holdings], [from, to]: [f64; 2], figure: impl Fn(&Holdings) -> f64) -> f64 {
    let within = |one: &&Holdings| {
        let place = (one.seconds - WARM) / (DANCE - WARM);
        (from..=to).contains(&place)
    };
    let figures = of.iter().filter(within).map(figure);
    figures.fold(f64::MIN, f64::max)
}

/// That the end holds no more than the time after the warm-up did.
fn assert_flat(report: &Report) {
    let shown = report.figures["frames"]["shown"].as_u64();
    assert!(shown >= Some(FEWEST), "{shown:?} frames");
    let held = &report.holdings;
    let growth = |figure: fn(&Holdings) -> f64| {
        let (early, late) = (
            most(held, [0.0, 0.4], figure),
            most(held, [0.6, 1.01], figure),
        );
        println!("{early} bytes or files early, {late} late");
        late - early
    };
    let resident = growth(|one| one.resident as f64);
    assert!(
        resident < MOST_RESIDENT,
        "resident: {resident} more: {held:#?}"
    );
    let allocated = growth(|one| one.allocated as f64);
    assert!(
        allocated < MOST_ALLOCATED,
        "allocated: {allocated} more: {held:#?}"
    );
    let device = growth(|one| one.device as f64);
    assert!(device <= 0.0, "on the device: {device} more: {held:#?}");
    let files = growth(|one| one.files as f64);
    assert!(files <= 0.0, "open files: {files} more: {held:#?}");
}

#[test]
fn dancing_before_a_head_that_sways_holds_no_more_memory_at_its_end() {
    attended(|| {
        let Some(_alone) = turn() else { return };
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let report = Run::start(&monado, DANCE).report();
        assert_flat(&report);
        // Nothing is made or given back on the way.
        let device = report.holdings.iter().filter(|one| one.seconds > WARM);
        let mut device: Vec<u64> = device.map(|one| one.device).collect();
        device.dedup();
        assert_eq!(device.len(), 1, "on the device: {device:?} bytes");
    });
}

#[test]
fn the_panel_of_figures_gives_back_all_it_takes_however_often_it_is_shown() {
    attended(|| {
        let Some(_alone) = turn() else { return };
        let Some(monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut head = monado.head();
        let mut run = Run::start(&monado, DANCE);
        sway_and_toggle(&mut head, &mut run);
        let report = run.report();
        assert_flat(&report);
        // With the panel and without it, and nothing else.
        let held = &report.holdings;
        let device = held.iter().filter(|one| one.seconds > WARM);
        let mut device: Vec<u64> = device.map(|one| one.device).collect();
        device.dedup();
        let changes = device.len() - 1;
        device.sort_unstable();
        device.dedup();
        println!("{changes} changes between {device:?} bytes on the device");
        assert_eq!(device.len(), 2, "with the panel, and without: {device:?}");
        assert!(changes >= 8, "shown and put away: {changes} times");
    });
}

/// Moves the head as somebody does who stands, and presses the button for the panel every two seconds, until the program ends.
fn sway_and_toggle(head: &mut Head, run: &mut Run) {
    let begun = Instant::now();
    while run.is_running() {
        let time = begun.elapsed().as_secs_f32();
        let turn = Quat::from_rotation_y(0.3 * (0.9 * time).sin())
            * Quat::from_rotation_x(0.1 * (1.3 * time).sin());
        let place = Pose::at(0.1 * (0.7 * time).sin(), 1.6, 0.05 * (1.1 * time).cos());
        let mut scripted = Scripted {
            stage_from_head: place.turned(turn),
            ..Scripted::default()
        };
        let pressed = time.rem_euclid(2.0) < 0.6;
        let left = &mut scripted.controllers[0];
        (left.system, left.b) = (pressed, pressed);
        head.send(&scripted);
        std::thread::sleep(Duration::from_millis(20));
    }
}
