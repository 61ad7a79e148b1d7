#![allow(
    clippy::cast_possible_truncation,
    reason = "a simulated call is minutes long"
)]

use super::*;
use proptest::prelude::*;

/// A path and two clocks with a known offset.
struct World {
    random: fastrand::Rng,
    /// Sender's clock minus ours at time 0, microseconds, and how it drifts.
    offset: f64,
    drift_ppm: f64,
    base_us: u64,
}

impl World {
    fn new(offset: f64, drift_ppm: f64) -> Self {
        Self {
            random: fastrand::Rng::with_seed(7),
            offset,
            drift_ppm,
            base_us: 20_000,
        }
    }

    fn truth(&self, local: u64) -> f64 {
        self.offset + self.drift_ppm * 1e-6 * (local - START) as f64
    }

    fn sender(&self, local: u64) -> Micros {
        Micros((local as f64 + self.truth(local)).round() as u64)
    }

    /// One exchange begun at `local`, with jitter of each way up to the given microseconds.
    fn exchange(&mut self, local: u64, jitter: [u64; 2]) -> Exchange {
        let there = local + self.base_us + self.random.u64(0..=jitter[0]);
        let left = there + self.random.u64(0..300);
        let back = left + self.base_us + self.random.u64(0..=jitter[1]);
        Exchange {
            sent: Micros(local),
            arrived: self.sender(there),
            left: self.sender(left),
            returned: Micros(back),
        }
    }
}

const START: u64 = 1_700_000_000_000_000;
const EVERY: u64 = 33_000;

#[test]
fn the_offset_is_within_a_millisecond_under_asymmetric_jitter_spikes_and_drift() {
    for (offset, drift) in [(5e6, 0.0), (-3.6e9, 40.0), (1e3, -40.0)] {
        for jitter in [[0, 0], [500, 40_000], [40_000, 2_000]] {
            let mut world = World::new(offset, drift);
            let mut clock = ClockOffset::new();
            let mut worst = 0.0f64;
            for turn in 0..2000u64 {
                let local = START + turn * EVERY;
                let spike = if turn % 17 == 3 { 300_000 } else { 0 };
                let exchange = world.exchange(local, [jitter[0] + spike, jitter[1]]);
                clock
                    .observe(&exchange)
                    .expect("a true exchange is believed");
                if turn > 150 {
                    let truth = world.truth(exchange.returned.0);
                    let found = clock.offset_us().expect("exchanges have come");
                    worst = worst.max((found as f64 - truth).abs());
                    let bound = clock.uncertainty().expect("exchanges have come");
                    assert!(
                        (found as f64 - truth).abs() <= bound.as_micros() as f64 + 500.0,
                        "the truth lies beyond the stated uncertainty {bound:?}"
                    );
                }
            }
            println!(
                "offset {offset}, drift {drift} ppm, jitter {jitter:?} us: {worst:.0} us off at worst"
            );
            // Without jitter only the drift within the window is left to be wrong about.
            let aim = if jitter == [0, 0] { 100.0 } else { 1000.0 };
            assert!(
                worst < aim,
                "{worst} us off with jitter {jitter:?} us and drift {drift} ppm"
            );
            let round_trip = clock
                .round_trip()
                .expect("exchanges have come")
                .as_micros()
                .abs_diff(40_000);
            assert!(round_trip < 3000, "round trip is {round_trip} us off 40 ms");
        }
    }
}

#[test]
fn mapped_capture_times_never_go_back_while_the_estimate_moves() {
    // The first pongs take 200 ms, so that the estimate starts 100 ms off; later two seconds pass without any.
    let mut world = World::new(5e6, 40.0);
    let mut clock = ClockOffset::new();
    let mut first_off = None;
    for turn in 0..600u64 {
        let local = START + turn * EVERY + if turn > 40 { 2_000_000 } else { 0 };
        let mut exchange = world.exchange(local, [1_000, 1_000]);
        if turn < 5 {
            exchange.returned.0 += 200_000;
        }
        let captured = world.sender(local);
        let before = clock.to_local(captured);
        clock
            .observe(&exchange)
            .expect("a true exchange is believed");
        if turn > 4 {
            let off = clock.offset_us().expect("exchanges have come") as f64 - world.truth(local);
            first_off.get_or_insert(off);
            let apart = ClockOffset::MAX_STEP_US.unsigned_abs() + 1;
            let after = clock.to_local(Micros(captured.0 + apart));
            assert!(after > before, "time went from {before:?} to {after:?}");
        }
    }
    let first_off = first_off.expect("many turns");
    assert!(first_off < -80_000.0, "only {first_off} us off at first");
    let end = START + 600 * EVERY + 2_000_000;
    let off = clock.offset_us().expect("exchanges have come") as f64 - world.truth(end);
    assert!(off.abs() < 1000.0, "{off} us off at the end");
}

#[test]
fn impossible_exchanges_are_refused_by_name_and_change_nothing() {
    let mut world = World::new(5e6, 0.0);
    let mut clock = ClockOffset::new();
    for turn in 0..100u64 {
        let exchange = world.exchange(START + turn * EVERY, [1000, 1000]);
        clock
            .observe(&exchange)
            .expect("a true exchange is believed");
    }
    let before = clock.offset_us();
    let good = world.exchange(START + 100 * EVERY, [0, 0]);
    let cases = [
        (
            Exchange {
                arrived: Micros(u64::MAX),
                ..good
            },
            "Range",
        ),
        (
            Exchange {
                left: Micros(good.arrived.0 - 1),
                ..good
            },
            "Backwards",
        ),
        (
            Exchange {
                sent: Micros(good.returned.0 + 1),
                ..good
            },
            "Backwards",
        ),
        (
            Exchange {
                left: Micros(good.left.0 + 1_000_000),
                ..good
            },
            "Held",
        ),
        (
            Exchange {
                sent: Micros(0),
                ..good
            },
            "Old",
        ),
        (
            Exchange {
                arrived: Micros(good.arrived.0 + 3_000_000),
                left: Micros(good.left.0 + 3_000_000),
                ..good
            },
            "Contradiction",
        ),
    ];
    for (exchange, name) in cases {
        let refused = clock.observe(&exchange).expect_err(name);
        assert!(
            format!("{refused:?}").starts_with(name),
            "{refused:?} instead of {name}"
        );
        assert_eq!(clock.offset_us(), before, "{name} moved the offset");
    }
}

#[test]
fn a_sender_with_another_clock_is_believed_after_eight_exchanges() {
    let mut clock = ClockOffset::new();
    let mut world = World::new(5e6, 0.0);
    for turn in 0..100u64 {
        let exchange = world.exchange(START + turn * EVERY, [1000, 1000]);
        clock
            .observe(&exchange)
            .expect("a true exchange is believed");
    }
    world.offset = -9e9;
    let mut refused = 0;
    for turn in 100..130u64 {
        let exchange = world.exchange(START + turn * EVERY, [1000, 1000]);
        refused += u32::from(clock.observe(&exchange).is_err());
    }
    assert_eq!(
        refused,
        CONTRADICTIONS - 1,
        "refusals before it is believed"
    );
    assert_eq!(clock.restarts(), 1, "one change of clock");
    let off = clock.offset_us().expect("exchanges have come") + 9_000_000_000;
    assert!(off.abs() < 1000, "{off} us off the new clock");
}

#[test]
fn a_clock_counts_from_the_unix_epoch_and_never_goes_back() {
    let clock = Clock::start();
    let anchor = clock.anchor;
    assert!(
        clock.now().0 > START,
        "the clock shows a time before this test was written"
    );
    assert_eq!(
        clock.at(anchor + Duration::from_millis(5)).0 - clock.at(anchor).0,
        5_000,
        "5 ms later"
    );
    if let Some(before) = anchor.checked_sub(Duration::from_secs(1)) {
        assert_eq!(clock.at(before), clock.at(anchor), "before the start");
    }
}

proptest! {
    #[test]
    fn no_times_from_the_wire_break_the_estimate(
        times in proptest::collection::vec(any::<[u64; 4]>(), 1..40),
        near in proptest::collection::vec(proptest::array::uniform4(0u64..2_000_000), 1..200),
    ) {
        let mut clock = ClockOffset::new();
        for [sent, arrived, left, returned] in times.into_iter().chain(near) {
            let _outcome = clock.observe(&Exchange {
                sent: Micros(sent),
                arrived: Micros(arrived),
                left: Micros(left),
                returned: Micros(returned),
            });
            let _mapped = clock.to_local(Micros(arrived));
            let _bound = clock.uncertainty();
        }
    }
}
