use super::*;
use crate::{BitRate, Outage, Probability, Rate, Reordering, Trace};

const MS: Duration = Duration::from_millis(1);
const SEED: u64 = 20_260;

fn p(value: f64) -> Probability {
    Probability::new(value).expect("a probability")
}

fn steady(kbit_s: f64) -> Option<Rate> {
    Some(Rate::Steady(BitRate::from_kbit_s(kbit_s).expect("a rate")))
}

/// Offers `count` packets of 100 bytes, one each `spacing`; their times and fates.
fn run(impairment: Impairment, count: u32, spacing: Duration) -> Vec<(Duration, Fate)> {
    let mut link = Link::new(impairment, SEED, Duration::ZERO);
    (0..count)
        .map(|n| {
            let now = spacing * n;
            (now, link.offer(now, 100))
        })
        .collect()
}

fn arrivals(fates: &[(Duration, Fate)]) -> Vec<(Duration, Duration)> {
    fates
        .iter()
        .filter_map(|&(sent, fate)| match fate {
            Fate::Delivered { at, .. } => Some((sent, at)),
            Fate::Lost(_) => None,
        })
        .collect()
}

/// Whether `hits` of `n` is within 4 standard deviations of the binomial distribution around n q.
fn assert_binomial(what: &str, hits: usize, n: usize, q: f64) {
    let (mean, deviation) = (n as f64 * q, (n as f64 * q * (1.0 - q)).sqrt());
    assert!(
        (hits as f64 - mean).abs() <= 4.0 * deviation,
        "{what}: {hits} of {n}, where {mean} +- {deviation} are due"
    );
}

#[test]
fn a_perfect_network_delivers_everything_at_once() {
    for (sent, fate) in run(Impairment::default(), 1000, MS) {
        let due = Fate::Delivered {
            at: sent,
            copy_at: None,
        };
        assert_eq!(fate, due, "sent at {sent:?}");
    }
}

#[test]
fn loss_duplication_and_reordering_come_as_often_as_asked() {
    const N: u32 = 50_000;
    for q in [0.001, 0.01, 0.05, 0.1, 0.5] {
        let fates = run(
            Impairment {
                loss: Loss::Independent(p(q)),
                ..Impairment::default()
            },
            N,
            MS,
        );
        assert_binomial("lost", N as usize - arrivals(&fates).len(), N as usize, q);

        let fates = run(
            Impairment {
                duplication: p(q),
                ..Impairment::default()
            },
            N,
            MS,
        );
        let twice = fates
            .iter()
            .filter(|(_, fate)| {
                matches!(
                    fate,
                    Fate::Delivered {
                        copy_at: Some(_),
                        ..
                    }
                )
            })
            .count();
        assert_binomial("doubled", twice, N as usize, q);

        let fates = run(
            Impairment {
                delay: 20 * MS,
                reordering: Reordering {
                    probability: p(q),
                    hold: 5 * MS,
                },
                ..Impairment::default()
            },
            N,
            MS,
        );
        let arrived = arrivals(&fates);
        let held = arrived.iter().filter(|(sent, at)| *at - *sent == 25 * MS);
        assert_binomial("held back", held.count(), N as usize, q);
        // A held packet comes with or after its fifth successor: it is overtaken unless the next four are held too.
        let overtaken = arrived
            .windows(2)
            .filter(|pair| matches!(pair, [(_, first), (_, second)] if second < first))
            .count();
        assert_binomial(
            "overtaken by the next",
            overtaken,
            N as usize,
            q * (1.0 - q),
        );
    }
}

#[test]
fn bursts_lose_the_share_asked_in_runs_of_the_length_asked() {
    const N: u32 = 400_000;
    let loss = Loss::bursts(0.05, 8.0).expect("possible bursts");
    assert!((loss.share() - 0.05).abs() < 1e-12, "{}", loss.share());
    let fates = run(
        Impairment {
            loss,
            ..Impairment::default()
        },
        N,
        MS,
    );
    let lost: Vec<bool> = fates
        .iter()
        .map(|(_, fate)| *fate == Fate::Lost(Cause::Chance))
        .collect();
    let count = lost.iter().filter(|&&l| l).count() as f64;
    let bursts = lost.windows(2).filter(|w| *w == [false, true]).count() as f64;
    // Bursts are geometric (deviation about their mean of 8), some N * 0.05 / 8 = 2500 of them: 4 deviations of a mean are 8 %.
    assert!((count / bursts - 8.0).abs() < 0.64, "{}", count / bursts);
    // Each burst and the gap before it vary about as much as their means: the share's deviation is some 3 %, 4 are 12 %.
    let share = count / f64::from(N);
    assert!((share - 0.05).abs() < 0.006, "{share}");
}

#[test]
fn impossible_bursts_and_probabilities_are_refused() {
    for (share, length) in [
        (1.0, 3.0),
        (-0.1, 3.0),
        (0.1, 0.5),
        (0.9, 2.0),
        (0.1, f64::NAN),
    ] {
        assert!(
            Loss::bursts(share, length).is_err(),
            "{share} in bursts of {length}"
        );
    }
    for q in [-0.01, 1.01, f64::NAN] {
        assert!(Probability::new(q).is_err(), "{q}");
    }
    for kbit_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(BitRate::from_kbit_s(kbit_s).is_err(), "{kbit_s}");
    }
}

#[test]
fn jitter_has_the_distribution_asked_where_packets_are_far_apart() {
    const N: u32 = 20_000;
    let spread = 10 * MS;
    for (jitter, mean_ms, deviation_ms, least_ms, most_ms) in [
        (
            Jitter::Uniform(spread),
            50.0,
            10.0 / 3.0_f64.sqrt(),
            40.0,
            60.0,
        ),
        // Cut at 3 deviations, the normal distribution's own is 0.9866 of what it was.
        (Jitter::Normal(spread), 50.0, 9.87, 20.0, 80.0),
        (Jitter::Exponential(spread), 60.0, 10.0, 50.0, f64::INFINITY),
    ] {
        let fates = run(
            Impairment {
                delay: 50 * MS,
                jitter,
                ..Impairment::default()
            },
            N,
            1000 * MS,
        );
        let delays: Vec<f64> = arrivals(&fates)
            .iter()
            .map(|(sent, at)| (*at - *sent).as_secs_f64() * 1000.0)
            .collect();
        let n = f64::from(N);
        let mean = delays.iter().sum::<f64>() / n;
        let deviation = (delays.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
        assert!(
            (mean - mean_ms).abs() < 4.0 * deviation_ms / n.sqrt(),
            "{jitter:?}: mean {mean}"
        );
        // The deviation of a deviation: at most (exponential) sqrt(2 / n) of it.
        assert!(
            (deviation / deviation_ms - 1.0).abs() < 4.0 * (2.0 / n).sqrt() + 0.001,
            "{jitter:?}: deviation {deviation}"
        );
        assert!(
            delays.iter().all(|d| (least_ms..=most_ms).contains(d)),
            "{jitter:?}: beyond its bounds"
        );
    }
}

#[test]
fn jitter_alone_never_reorders() {
    let fates = run(
        Impairment {
            delay: 20 * MS,
            jitter: Jitter::Normal(15 * MS),
            ..Impairment::default()
        },
        10_000,
        MS,
    );
    let arrived = arrivals(&fates);
    assert_eq!(arrived.len(), 10_000, "nothing is lost");
    assert!(
        arrived.is_sorted_by_key(|(_, at)| *at),
        "one came before the one sent before it"
    );
    assert!(
        arrived.iter().all(|(sent, at)| at >= sent),
        "one came before it was sent"
    );
}

#[test]
fn the_same_seed_decides_the_same_and_another_otherwise() {
    let impairment = Impairment {
        delay: 20 * MS,
        jitter: Jitter::Exponential(3 * MS),
        loss: Loss::bursts(0.05, 3.0).expect("possible bursts"),
        reordering: Reordering {
            probability: p(0.02),
            hold: 10 * MS,
        },
        duplication: p(0.01),
        rate: steady(700.0),
        ..Impairment::default()
    };
    let with = |seed| {
        let mut link = Link::new(impairment.clone(), seed, Duration::ZERO);
        (0..5000)
            .map(|n| link.offer(MS * n, 100))
            .collect::<Vec<_>>()
    };
    assert_eq!(with(1), with(1), "the same seed");
    assert_ne!(with(1), with(2), "another seed");
}

#[test]
fn the_same_packets_are_lost_whatever_their_times() {
    let lossy = Impairment {
        loss: Loss::bursts(0.1, 4.0).expect("possible bursts"),
        jitter: Jitter::Uniform(MS),
        ..Impairment::default()
    };
    let lost = |spacing| {
        run(lossy.clone(), 5000, spacing)
            .iter()
            .map(|(_, fate)| *fate == Fate::Lost(Cause::Chance))
            .collect::<Vec<_>>()
    };
    assert_eq!(lost(MS), lost(17 * MS), "spacing must not matter");
}

#[test]
fn a_steady_rate_spaces_packets_by_exactly_what_they_take() {
    // 100 bytes at 200 kbit/s take 4 ms. A burst of ten leaves one each 4 ms; one after a pause starts at once.
    let mut link = Link::new(
        Impairment {
            delay: 20 * MS,
            rate: steady(200.0),
            ..Impairment::default()
        },
        SEED,
        Duration::ZERO,
    );
    let due = |at| Fate::Delivered { at, copy_at: None };
    for n in 1..=10 {
        assert_eq!(
            link.offer(Duration::ZERO, 100),
            due(20 * MS + 4 * MS * n),
            "packet {n}"
        );
    }
    assert_eq!(
        link.backlog(15 * MS),
        Backlog {
            bytes: 700,
            wait: 25 * MS
        },
        "three have left after 15 ms"
    );
    assert_eq!(link.offer(100 * MS, 100), due(124 * MS), "after a pause");
}

#[test]
fn a_trace_is_replayed_exactly_and_its_outage_holds_packets() {
    // 100 bytes are 800 bits: 8 ms at 100 kbit/s, 80 ms at 10; between them nothing goes for 100 ms.
    let trace = Trace::parse("t", "ms,kbit/s\n0,100\n20,0\n120,10\n220,100\n").expect("a trace");
    assert_eq!(trace.period(), 320 * MS, "the last line holds for 100 ms");
    let mut link = Link::new(
        Impairment {
            rate: Some(Rate::Trace(trace.into())),
            queue: Queue::Bytes(10_000),
            ..Impairment::default()
        },
        SEED,
        1000 * MS,
    );
    // The trace begins when it is put in place, at 1 s. 16 ms take two packets; the third has 400 bits out by 20 ms, 400 more take
    // 40 ms from 120 on; the fourth 60 ms for 600 and 2 ms for the other 200.
    for (n, ms) in [(1, 8), (2, 16), (3, 160), (4, 222), (5, 230)] {
        let due = Fate::Delivered {
            at: 1000 * MS + ms * MS,
            copy_at: None,
        };
        assert_eq!(link.offer(1000 * MS, 100), due, "packet {n}");
    }
    // The second lap.
    let due = Fate::Delivered {
        at: 1328 * MS,
        copy_at: None,
    };
    assert_eq!(link.offer(1320 * MS, 100), due, "in the second lap");
}

#[test]
fn packets_that_do_not_fit_in_the_queue_are_dropped() {
    let with = |queue| {
        let impairment = Impairment {
            rate: steady(200.0),
            queue,
            ..Impairment::default()
        };
        let mut link = Link::new(impairment, SEED, Duration::ZERO);
        let fates: Vec<Fate> = (0..20).map(|_| link.offer(Duration::ZERO, 100)).collect();
        let kept = fates
            .iter()
            .filter(|f| matches!(f, Fate::Delivered { .. }))
            .count();
        assert!(
            fates
                .iter()
                .skip(kept)
                .all(|f| *f == Fate::Lost(Cause::Queue)),
            "the tail is dropped: {fates:?}"
        );
        // 4 ms later one has left, and one more fits.
        assert_ne!(
            link.offer(4 * MS, 100),
            Fate::Lost(Cause::Queue),
            "there is room again"
        );
        assert_eq!(link.offer(4 * MS, 100), Fate::Lost(Cause::Queue), "for one");
        kept
    };
    assert_eq!(with(Queue::Bytes(500)), 5, "500 bytes are five packets");
    // The sixth would wait 20 ms, the seventh 24.
    assert_eq!(
        with(Queue::Time(20 * MS)),
        6,
        "20 ms are five packets before one's own"
    );
}

#[test]
fn an_outage_loses_the_packets_offered_in_it_and_no_others() {
    let fates = run(
        Impairment {
            delay: 20 * MS,
            outages: vec![
                Outage {
                    at: 100 * MS,
                    length: 50 * MS,
                },
                Outage {
                    at: 200 * MS,
                    length: 1 * MS,
                },
            ],
            ..Impairment::default()
        },
        300,
        MS,
    );
    for (n, (_, fate)) in fates.iter().enumerate() {
        let is_out = (100..150).contains(&n) || n == 200;
        assert_eq!(*fate == Fate::Lost(Cause::Outage), is_out, "at {n} ms");
    }
}

#[test]
fn a_new_impairment_holds_from_when_it_is_put_in_place() {
    let mut link = Link::new(Impairment::default(), SEED, Duration::ZERO);
    assert_eq!(
        link.offer(MS, 100),
        Fate::Delivered {
            at: MS,
            copy_at: None
        },
        "the first"
    );
    let out = Impairment {
        delay: 5 * MS,
        outages: vec![Outage {
            at: 10 * MS,
            length: 10 * MS,
        }],
        ..Impairment::default()
    };
    link.set(out, 100 * MS);
    assert_eq!(
        link.offer(105 * MS, 100),
        Fate::Delivered {
            at: 110 * MS,
            copy_at: None
        },
        "its outage has not come"
    );
    assert_eq!(
        link.offer(112 * MS, 100),
        Fate::Lost(Cause::Outage),
        "10 ms after it was set"
    );
}
