//! What becomes of the frames of a call over networks that lose, delay and narrow.

use crate::house::{House, assert_nothing_refused, count, number, through};
use netlab::{BitRate, Impairment, Loss, Probability, Rate, Statistics};
use serde_json::Value;
use std::time::Duration;

const SECONDS: &str = "8";

/// What the two ends and the lab say of one call.
struct Outcome {
    sent: Value,
    call: Value,
    lab: Statistics,
}

/// One call to its end, by the sender's hanging up.
fn call(down: Impairment, up: Impairment, seconds: &str, arguments: &[&str]) -> Outcome {
    let house = House::open();
    let lab = house.lab(down, up);
    let sender = house.sender(&[&["--seconds", seconds], arguments].concat());
    let receiver = house.receiver(&through(&lab, &sender.viewers), "viewer", &[]);
    let sent = sender.program.report();
    let mut received = receiver.report();
    let outcome = Outcome {
        sent,
        call: received["call"].take(),
        lab: house.runtime.block_on(lab.stop()),
    };
    outcome.assert_sound();
    outcome
}

impl Outcome {
    fn captured(&self) -> u64 {
        count(&self.sent, "captured")
    }

    fn skipped(&self) -> u64 {
        count(&self.sent, "skipped")
    }

    fn shown(&self) -> u64 {
        count(&self.call, "released")
    }

    /// Frames that were sent and never shown.
    fn lost(&self) -> u64 {
        count(&self.sent, "sent") - self.shown()
    }

    /// What holds in every call without an outage: one connection, whose frames are all of it and come in order.
    fn assert_sound(&self) {
        let (sent, call) = (&self.sent, &self.call);
        let received = &call["received"];
        assert_eq!(count(received, "sessions"), 1, "{call:#}");
        assert_eq!(count(sent, "joined"), 1, "{sent:#}");
        assert_nothing_refused(call);
        assert_eq!(
            count(sent, "sent") + self.skipped(),
            self.captured(),
            "each frame is sent or skipped: {sent:#}"
        );
        assert_eq!(count(received, "overrun"), 0, "{call:#}");
        assert_eq!(count(received, "frames"), self.shown(), "{call:#}");
        // No frame overtook another in the lab, so none did at all.
        for none in ["passed", "reordered", "duplicate"] {
            assert_eq!(count(call, none), 0, "{none}: {call:#}");
        }
        let gaps = count(call, "lost");
        assert!(
            self.shown() + gaps <= self.captured(),
            "{gaps} gaps in the sequence: {call:#}, {sent:#}"
        );
    }

    /// As many are missing as the network loses by chance: within four deviations.
    fn assert_lost_by_chance(&self, share: f64) {
        let frames = count(&self.sent, "sent") as f64;
        let mean = frames * share;
        let spread = 4.0 * (mean * (1.0 - share)).sqrt();
        let lost = self.lost() as f64;
        assert!(
            (lost - mean).abs() <= spread,
            "{lost} of {frames} frames are lost, not {mean:.1} +- {spread:.1}"
        );
    }

    fn assert_whole(&self) {
        assert_eq!(
            self.lost(),
            0,
            "frames sent and never shown: {:#} {:#}",
            self.call,
            self.sent
        );
    }
}

fn line() -> Impairment {
    Impairment {
        delay: Duration::from_millis(20),
        ..Impairment::default()
    }
}

fn lossy(share: f64) -> Impairment {
    Impairment {
        loss: Loss::Independent(Probability::new(share).expect("a share")),
        ..line()
    }
}

fn narrow() -> Impairment {
    Impairment {
        rate: Some(Rate::Steady(BitRate::from_kbit_s(200.0).expect("a rate"))),
        ..line()
    }
}

#[test]
fn a_clean_network_loses_nothing_of_either_codec() {
    for codec in ["compact", "paper"] {
        let clean = Impairment::default;
        let outcome = call(clean(), clean(), "3", &["--codec", codec]);
        outcome.assert_whole();
        assert_eq!(outcome.call["announced"]["codec"], codec, "as announced");
    }
}

#[test]
fn the_unreliable_channel_loses_what_a_network_of_1_percent_loses() {
    let outcome = call(lossy(0.01), lossy(0.01), SECONDS, &["--rate", "60"]);
    outcome.assert_lost_by_chance(0.01);
}

#[test]
fn the_unreliable_channel_loses_what_a_network_of_5_percent_loses() {
    let outcome = call(lossy(0.05), lossy(0.05), SECONDS, &["--rate", "60"]);
    outcome.assert_lost_by_chance(0.05);
}

#[test]
fn the_unreliable_channel_loses_what_a_network_of_10_percent_loses() {
    let paper = ["--rate", "60", "--codec", "paper"];
    let outcome = call(lossy(0.1), lossy(0.1), SECONDS, &paper);
    outcome.assert_lost_by_chance(0.1);
}

#[test]
fn the_reliable_channel_shows_all_that_is_sent_though_1_percent_is_lost() {
    let outcome = call(
        lossy(0.01),
        lossy(0.01),
        SECONDS,
        &["--channel", "reliable"],
    );
    outcome.assert_whole();
}

#[test]
fn the_reliable_channel_shows_all_that_is_sent_though_5_percent_is_lost() {
    let reliable = ["--channel", "reliable", "--codec", "paper"];
    let outcome = call(lossy(0.05), lossy(0.05), SECONDS, &reliable);
    outcome.assert_whole();
    assert!(outcome.lab.down.lost.chance > 0, "the lab did lose");
}

#[test]
fn one_way_latency_is_real_on_a_path_that_is_longer_one_way() {
    let up = Impairment {
        delay: Duration::from_millis(21),
        ..Impairment::default()
    };
    let outcome = call(line(), up, "3", &[]);
    outcome.assert_whole();
    let received = &outcome.call["received"];
    let round_trip_ms = number(received, "round_trip_us") / 1e3;
    assert!(round_trip_ms >= 41.0, "{round_trip_ms} ms there and back");
    // Two clocks of one machine: they differ by no more than what the path's asymmetry hides, a moment between two readings aside.
    let hidden_ms = (round_trip_ms - 40.0) / 2.0;
    let offset_ms = number(received, "clock_offset_us") / 1e3;
    assert!(
        offset_ms.abs() <= hidden_ms + 5.0,
        "{offset_ms} ms between the clocks of one machine, by a round trip of {round_trip_ms} ms"
    );
    let latency = &outcome.call["latency"]["network"];
    let one_way_ms = number(latency, "p50_ms");
    assert!(
        one_way_ms >= 20.0 - hidden_ms - 5.0,
        "{one_way_ms} ms on a way of 20 ms, by a round trip of {round_trip_ms} ms"
    );
}

#[test]
fn compact_loses_nothing_on_a_line_of_200_kbit_s() {
    let outcome = call(narrow(), line(), SECONDS, &["--rate", "60"]);
    outcome.assert_whole();
    assert_eq!(outcome.lab.down.lost.total(), 0, "it fits the line");
}

#[test]
fn what_does_not_fit_the_line_is_skipped_and_the_call_goes_on() {
    let outcome = call(
        narrow(),
        line(),
        SECONDS,
        &["--rate", "60", "--codec", "paper"],
    );
    let missing = outcome.skipped() + outcome.lost();
    assert!(
        missing > 0,
        "240 kbit/s went through 200: {:#}",
        outcome.sent
    );
    assert!(
        outcome.shown() * 2 > outcome.captured(),
        "more than half of it fits: {:#} {:#}",
        outcome.call,
        outcome.sent
    );
}
