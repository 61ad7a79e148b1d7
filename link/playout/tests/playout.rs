//! The jitter buffer on paths whose delays are known: what it adds, how many frames still come late, how it recovers.

#![allow(
    clippy::cast_possible_truncation,
    reason = "a simulated call is minutes long"
)]

use fastrand::Rng;
use link_codec::{Micros, MotionFrame};
use link_playout::JitterBuffer;

const START: u64 = 1_000_000_000;
/// The sender's clock is an hour ahead; the buffer does not know.
const AHEAD: u64 = 3_600_000_000;
/// Least transit of every path, microseconds.
const BASE: u64 = 20_000;
/// The display asks this often.
const TICK: u64 = 1_000;

/// A path: transit beyond [`BASE`] in microseconds of a frame captured `at` microseconds after the start; `None` loses it.
type Path = dyn FnMut(&mut Rng, u64) -> Option<u64>;

struct Call {
    rate_hz: u64,
    seconds: u64,
    /// Nothing overtakes anything, as in a reliable channel.
    in_order: bool,
    drift_ppm: i64,
}

const CALL: Call = Call {
    rate_hz: 60,
    seconds: 60,
    in_order: false,
    drift_ppm: 0,
};

/// What a call was like after its first two seconds.
struct Outcome {
    frames: u64,
    late: u64,
    passed: u64,
    stalls: u64,
    /// Delay that the buffer said it added, at every frame, milliseconds, sorted; and at the end.
    delays: Vec<f64>,
    final_delay: f64,
    /// Capture to release beyond [`BASE`] of the frames that were shown, milliseconds, in time's order.
    shown: Vec<(u64, f64)>,
}

impl Outcome {
    fn late_share(&self) -> f64 {
        (self.late + self.passed) as f64 / self.frames as f64
    }
    fn delay(&self, share: f64) -> f64 {
        self.delays[((self.delays.len() - 1) as f64 * share) as usize]
    }
    fn latency(&self, share: f64) -> f64 {
        let mut sorted: Vec<_> = self.shown.iter().map(|(_, ms)| *ms).collect();
        sorted.sort_by(f64::total_cmp);
        sorted[((sorted.len() - 1) as f64 * share) as usize]
    }
    fn print(&self, name: &str) {
        println!(
            "{name:<44} late {:5.2} % | delay p50 {:6.2} p99 {:6.2} end {:6.2} ms | capture to release beyond base p50 {:6.2} p99 {:6.2} ms | stalls {}",
            self.late_share() * 100.0,
            self.delay(0.5),
            self.delay(0.99),
            self.final_delay,
            self.latency(0.5),
            self.latency(0.99),
            self.stalls,
        );
    }
}

fn call(name: &str, call: &Call, path: &mut Path) -> Outcome {
    let mut random = Rng::with_seed(11);
    let mut frames = Vec::new();
    let mut latest = 0;
    for k in 0..call.rate_hz * call.seconds {
        let at = k * 1_000_000 / call.rate_hz;
        let Some(extra) = path(&mut random, at) else {
            continue;
        };
        let mut arrived = START + at + BASE + extra;
        if call.in_order {
            arrived = arrived.max(latest);
            latest = arrived;
        }
        let drift = at as i64 * call.drift_ppm / 1_000_000;
        let captured = (START + AHEAD + at).strict_add_signed(drift);
        frames.push((arrived, at, k as u32 + 1, captured));
    }
    frames.sort_unstable();
    let mut buffer = JitterBuffer::new();
    let mut before = buffer.statistics();
    let mut outcome = Outcome {
        frames: 0,
        late: 0,
        passed: 0,
        stalls: 0,
        delays: Vec::new(),
        final_delay: 0.0,
        shown: Vec::new(),
    };
    let mut arrivals = frames.iter().peekable();
    let mut now = START;
    let mut last = 0;
    while arrivals.peek().is_some() || buffer.waiting() > 0 {
        while let Some((arrived, at, sequence, captured)) =
            arrivals.next_if(|(arrived, ..)| *arrived <= now)
        {
            let frame = MotionFrame {
                sequence: *sequence,
                captured: Micros(*captured),
                ..MotionFrame::default()
            };
            buffer.push(frame, Micros(*arrived), Some(Micros(START + at)));
            let warm = *at > 2_000_000;
            if warm {
                outcome.frames += 1;
                outcome.delays.push(buffer.delay().as_secs_f64() * 1e3);
            } else {
                before = buffer.statistics();
            }
        }
        if let Some(newest) = buffer.take(Micros(now)).next_back() {
            assert!(newest.frame.sequence > last, "shown out of order");
            last = newest.frame.sequence;
            let captured = newest.timing.captured_local.expect("it was given").0;
            let beyond = (now - captured - BASE) as f64 / 1e3;
            if captured > START + 2_000_000 {
                outcome.shown.push((captured - START, beyond));
            }
        }
        now += TICK;
    }
    let after = buffer.statistics();
    outcome.late = after.late - before.late;
    outcome.passed = after.passed - before.passed;
    outcome.stalls = after.stalls;
    outcome.final_delay = after.delay.as_secs_f64() * 1e3;
    outcome.delays.sort_by(f64::total_cmp);
    outcome.print(name);
    outcome
}

#[test]
fn a_steady_path_gets_almost_no_delay() {
    for (name, jitter) in [
        ("constant", 0),
        ("loopback, 0.3 ms", 300),
        ("wire, 1 ms", 1_000),
    ] {
        for rate_hz in [30, 60] {
            let mut path = move |random: &mut Rng, _| Some(random.u64(0..=jitter));
            let outcome = call(
                &format!("{name}, {rate_hz} Hz"),
                &Call { rate_hz, ..CALL },
                &mut path,
            );
            assert!(outcome.delay(1.0) <= 1.1, "{} ms added", outcome.delay(1.0));
            assert!(outcome.late_share() <= 0.001, "{name}: frames came late");
            assert!(
                outcome.latency(0.99) <= jitter as f64 / 1e3 + 2.0,
                "{name}: {} ms beyond the path",
                outcome.latency(0.99)
            );
        }
    }
}

#[test]
fn jitter_is_covered_but_for_a_few_frames_and_not_overpaid() {
    for jitter_ms in [5u64, 20, 50, 100] {
        for rate_hz in [30, 60] {
            let mut path = move |random: &mut Rng, _| Some(random.u64(0..=jitter_ms * 1000));
            let outcome = call(
                &format!("uniform 0..{jitter_ms} ms, {rate_hz} Hz"),
                &Call { rate_hz, ..CALL },
                &mut path,
            );
            assert!(outcome.late_share() <= 0.03, "{jitter_ms} ms: late");
            assert!(
                outcome.delay(1.0) <= jitter_ms as f64
                    && outcome.delay(0.5) >= 0.9 * jitter_ms as f64,
                "{jitter_ms} ms: {} ms added",
                outcome.delay(0.5)
            );
        }
    }
    // A wireless link: mostly quick, a long tail.
    let mut path = |random: &mut Rng, _| {
        let tail = -6_000.0 * (1.0 - random.f64()).ln();
        (random.f64() > 0.02).then_some(tail as u64)
    };
    let outcome = call("exponential, mean 6 ms, 2 % lost", &CALL, &mut path);
    assert!(outcome.late_share() <= 0.03, "exponential: late");
    assert!(outcome.delay(0.5) < 30.0, "exponential: delay");
}

#[test]
fn rare_spikes_are_not_paid_for_and_frequent_ones_are() {
    let spikes = |share: f64| {
        move |random: &mut Rng, _: u64| {
            let spike = if random.f64() < share { 80_000 } else { 0 };
            Some(spike + random.u64(0..2_000))
        }
    };
    let outcome = call("80 ms spikes, 0.5 % of frames", &CALL, &mut spikes(0.005));
    assert!(outcome.delay(0.9) <= 3.0, "rare: {}", outcome.delay(0.9));
    assert!(outcome.late_share() <= 0.01, "rare: late");
    let outcome = call("80 ms spikes, 5 % of frames", &CALL, &mut spikes(0.05));
    assert!(
        outcome.delay(0.5) >= 78.0,
        "frequent: {}",
        outcome.delay(0.5)
    );
    assert!(outcome.late_share() <= 0.02, "frequent: late");
}

#[test]
fn drifting_clocks_cost_nothing() {
    for drift_ppm in [-100, 100] {
        let mut path = |random: &mut Rng, _| Some(random.u64(0..1_000));
        let outcome = call(
            &format!("drift {drift_ppm} ppm, 1 ms jitter, 5 min"),
            &Call {
                drift_ppm,
                seconds: 300,
                ..CALL
            },
            &mut path,
        );
        assert!(outcome.delay(1.0) <= 2.0, "{drift_ppm} ppm: delay");
        assert!(outcome.late_share() <= 0.02, "{drift_ppm} ppm: late");
    }
}

#[test]
fn a_path_that_becomes_longer_or_shorter_is_followed() {
    for (step_ms, late) in [(60i64, 0.01), (-60, 0.001), (400, 0.03), (-400, 0.01)] {
        let mut path = move |random: &mut Rng, at| {
            let stepped = if (at > 20_000_000) == (step_ms > 0) {
                step_ms.unsigned_abs() * 1000
            } else {
                0
            };
            Some(stepped + random.u64(0..2_000))
        };
        let outcome = call(
            &format!("step of {step_ms} ms after 20 s"),
            &CALL,
            &mut path,
        );
        assert!(
            outcome.final_delay <= 3.0,
            "{step_ms} ms: {} ms added at the end",
            outcome.final_delay
        );
        assert!(outcome.late_share() <= late, "{step_ms} ms: late");
        let settled = outcome
            .shown
            .iter()
            .filter(|(at, _)| *at > 20_000_000)
            .rev()
            .find(|(_, ms)| *ms > step_ms.max(0) as f64 + 6.0)
            .map_or(0.0, |(at, _)| (*at - 20_000_000) as f64 / 1e6);
        println!("    settled within {settled:.2} s");
        assert!(settled < 20.0, "{step_ms} ms: settled after {settled} s");
    }
}

#[test]
fn what_piled_up_behind_a_stall_is_skipped_and_costs_nothing_afterwards() {
    for stall_ms in [300u64, 1_000, 3_000] {
        let stall = stall_ms * 1000;
        let call_in_order = Call {
            in_order: true,
            ..CALL
        };
        // Every ten seconds nothing passes, then all of it at once.
        let mut path = move |random: &mut Rng, at: u64| {
            let into = at % 10_000_000;
            let held = (5_000_000 + stall).saturating_sub(into);
            let held = if into >= 5_000_000 { held } else { 0 };
            Some(held + random.u64(0..1_000))
        };
        let outcome = call(
            &format!("reliable, {stall_ms} ms stalls every 10 s"),
            &call_in_order,
            &mut path,
        );
        assert_eq!(outcome.stalls, 6, "{stall_ms} ms: stalls seen");
        assert!(
            outcome.delay(0.99) <= 2.0,
            "{stall_ms} ms: {}",
            outcome.delay(0.99)
        );
        // The first frame shown after each stall is the newest there is.
        let old = outcome.shown.iter().filter(|(_, ms)| *ms > 25.0).count();
        assert_eq!(old, 0, "{stall_ms} ms: old frames were replayed");
    }
}
