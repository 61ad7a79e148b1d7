//! A made-up report, for tests.

use super::{BitrateSeries, CallRow, Frames, LatencyMs, Report};

pub(crate) fn report() -> Report {
    let mut calls = Vec::new();
    for (condition, loss, factor) in [
        ("clean", 0, 1.0_f64),
        ("1 % lost", 18, 1.05),
        ("5 % lost", 90, 1.1),
        ("0.2 Mbit/s", 2, 1.6),
    ] {
        for (codec, kbit_s) in [("paper", 112.4), ("compact", 43.7)] {
            for (channel, tail) in [("reliable", 43.0_f64), ("unreliable", 1.2)] {
                let stuck = if loss == 0 { 1.1 } else { tail };
                calls.push(CallRow {
                    codec: codec.to_owned(),
                    channel: channel.to_owned(),
                    condition: condition.to_owned(),
                    down_kbit_s: kbit_s * factor.min(1.2),
                    up_kbit_s: 28.3,
                    latency_ms: Some(LatencyMs {
                        p50: 20.4 * factor,
                        p95: 21.9 * factor * stuck.sqrt(),
                        p99: 24.8 * factor * stuck,
                    }),
                    frames: Frames {
                        sent: 1800,
                        shown: if channel == "reliable" {
                            1800
                        } else {
                            1800 - loss
                        },
                    },
                    recover_s: (condition == "5 % lost").then_some(0.84),
                    voice: None,
                });
            }
        }
    }
    let over_time = |name: &str, base: f64, swing: f64| BitrateSeries {
        name: name.to_owned(),
        kbit_s: (0..60)
            .map(|s| {
                let out = if (30..33).contains(&s) { 0.1 } else { 1.0 };
                (base + swing * (f64::from(s) * 0.7).sin()) * out
            })
            .collect(),
    };
    Report {
        title: "Motion calls at 30 Hz over 20 ms each way".to_owned(),
        calls,
        bitrates: vec![
            over_time("paper, reliable", 121.0, 6.0),
            over_time("paper, unreliable", 112.0, 4.0),
            over_time("compact, reliable", 51.0, 5.0),
            over_time("compact, unreliable", 44.0, 3.0),
        ],
        notes: vec![
            "kbit/s count whole packets, IPv4 and UDP headers included. Latency is from the sender's capture time to the decoded frame on the viewer's \
             side, by the viewer's estimate of the sender's clock."
                .to_owned(),
        ],
    }
}
