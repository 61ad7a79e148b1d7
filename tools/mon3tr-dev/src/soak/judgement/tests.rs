use super::super::sample::Latency;
use super::*;

/// Of a call of an hour, as it should be.
const GOOD: Outcome = Outcome {
    opened: 3,
    connections: 1,
};

/// An hour's samples, each changed as `change` says of the share of the hour that has passed.
fn hour(change: impl Fn(&mut Sample, f64)) -> Vec<Sample> {
    (0..1800_u32)
        .map(|k| {
            let usage = Usage {
                resident_bytes: 300_000_000,
                descriptors: 40,
                threads: 30,
            };
            let mut sample = Sample {
                seconds: f64::from(k) * 2.0,
                processes: [usage; 3],
                shown: Some(Shown {
                    pictures: 40,
                    latency: Some(Latency {
                        p50_ms: 90.0,
                        p99_ms: 120.0,
                    }),
                    frames: u64::from(k) * 59,
                    lost: u64::from(k),
                    device_bytes: 80_000_000,
                }),
                validation_messages: 0,
                runtime: true,
                load: Some(1.0),
            };
            change(&mut sample, f64::from(k) / 1800.0);
            sample
        })
        .collect()
}

/// What fails of an hour.
fn failing(samples: &[Sample], outcome: Outcome) -> Vec<(&'static str, &'static str)> {
    let schedule = Schedule::of(Duration::from_mins(60));
    let rows = rows(samples, &schedule, outcome);
    let failing = rows.iter().filter(|row| row.good == Some(false));
    failing.map(|row| (row.of, row.what)).collect()
}

fn shown(sample: &mut Sample) -> &mut Shown {
    sample.shown.as_mut().expect("it is shown")
}

fn more(value: u64, share: f64) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and rounded on purpose"
    )]
    let more = (value as f64 * (1.0 + share)) as u64;
    more
}

#[test]
fn a_call_that_stays_as_it_was_passes() {
    assert_eq!(failing(&hour(|_, _| {}), GOOD), [], "flat");
    // What happens now and then, to single samples, is no growth.
    let samples = hour(|sample, at| {
        if (at * 1800.0) % 10.0 < 2.0 {
            sample.processes[2].threads += 4;
            shown(sample).latency = Some(Latency {
                p50_ms: 200.0,
                p99_ms: 900.0,
            });
        }
        // The headset's runtime is away.
        if (0.4..0.41).contains(&at) {
            sample.shown = None;
            sample.runtime = false;
            sample.processes[2].descriptors = 10;
        }
    });
    assert_eq!(failing(&samples, GOOD), [], "noise");
}

#[test]
fn memory_may_grow_by_a_fiftieth_in_each_process() {
    for (k, program) in PROGRAMS.into_iter().enumerate() {
        let grown = |by: f64| {
            hour(|sample, at| {
                let resident = &mut sample.processes[k].resident_bytes;
                *resident = more(*resident, by * at);
            })
        };
        assert_eq!(failing(&grown(0.02), GOOD), [], "{program}: a little");
        let leaks = [(program, "resident memory, MB")];
        assert_eq!(
            failing(&grown(0.03), GOOD),
            leaks,
            "{program}: 3 % in an hour"
        );
    }
}

#[test]
fn memory_that_each_restart_leaves_behind_is_growth() {
    let samples = hour(|sample, at| {
        let restarts = f64::from(u8::from(at > 0.4)) + f64::from(u8::from(at > 0.6));
        shown(sample).device_bytes = more(80_000_000, 0.05 * restarts);
    });
    assert_eq!(
        failing(&samples, GOOD),
        [("receive", "device memory, MB")],
        "the device's"
    );
}

#[test]
fn what_grows_is_not_hidden_by_what_a_restart_gives_back() {
    let samples = hour(|sample, at| {
        let given_back = if at > 0.6 { 0.1 } else { 0.0 };
        let resident = &mut sample.processes[2].resident_bytes;
        *resident = more(*resident, 0.1 * at - given_back);
    });
    let since = [("receive", "resident since restarts, MB")];
    assert_eq!(failing(&samples, GOOD), since, "3 % after the last restart");
}

#[test]
fn one_descriptor_or_thread_that_stays_is_one_too_many() {
    let samples = hour(|sample, at| sample.processes[0].descriptors += u64::from(at > 0.5));
    assert_eq!(failing(&samples, GOOD), [("serve", "descriptors")], "one");
    let samples = hour(|sample, at| sample.processes[1].threads += u64::from(at > 0.5));
    assert_eq!(failing(&samples, GOOD), [("send", "threads")], "one");
    let fewer = hour(|sample, at| sample.processes[1].threads -= u64::from(at > 0.5));
    assert_eq!(failing(&fewer, GOOD), [], "one that has ended");
}

#[test]
fn latency_may_grow_by_a_fifth() {
    let slower = |by: f64| {
        hour(|sample, at| {
            shown(sample).latency = Some(Latency {
                p50_ms: 90.0,
                p99_ms: 120.0 * (1.0 + by * at),
            });
        })
    };
    assert_eq!(failing(&slower(0.2), GOOD), [], "a little");
    let slow = [("receive", "capture to display, p99, ms")];
    assert_eq!(failing(&slower(0.25), GOOD), slow, "by a quarter");
}

#[test]
fn one_validation_message_at_any_time_is_too_many() {
    let samples = hour(|sample, at| sample.validation_messages = u64::from(at > 0.01));
    assert_eq!(
        failing(&samples, GOOD),
        [("receive", "validation messages")],
        "one"
    );
}

#[test]
fn a_call_that_broke_off_fails() {
    let samples = hour(|_, _| {});
    let again = Outcome {
        connections: 2,
        ..GOOD
    };
    let broken = [("receive", "connections with the sender")];
    assert_eq!(failing(&samples, again), broken, "joined again");
    let gone = Outcome { opened: 2, ..GOOD };
    let lost = [("receive", "headset opened, times")];
    assert_eq!(failing(&samples, gone), lost, "not opened again");
}

#[test]
fn what_is_not_known_is_not_good() {
    let blind = hour(|sample, at| {
        if at > 0.8 {
            sample.shown = None;
        }
    });
    let unknown = [
        ("receive", "device memory, MB"),
        ("receive", "capture to display, p99, ms"),
    ];
    assert_eq!(failing(&blind, GOOD), unknown, "no pictures at the end");
    assert!(!failing(&[], GOOD).is_empty(), "no samples");
}

#[test]
fn the_table_says_what_fails() {
    let samples = hour(|sample, at| sample.processes[0].descriptors += u64::from(at > 0.5));
    let schedule = Schedule::of(Duration::from_mins(60));
    let table = table(&rows(&samples, &schedule, GOOD));
    let failing: Vec<_> = table
        .iter()
        .filter(|line| line.ends_with("FAILS"))
        .collect();
    let [line] = failing[..] else {
        panic!("one line: {table:#?}")
    };
    let words: Vec<_> = line.split_whitespace().collect();
    let told = [
        "serve",
        "descriptors",
        "40",
        "41",
        "+2.5",
        "%",
        "no",
        "more",
        "FAILS",
    ];
    assert_eq!(words, told, "{table:#?}");
}
