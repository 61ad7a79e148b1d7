//! Writes the synthetic traces in `tools/netlab/traces`, the same each time. They are not measured: each file's head says its formula.
//!
//! `cargo run -p netlab --example make_traces -- tools/netlab/traces`

use std::{fmt::Write as _, path::Path};

fn main() -> std::io::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "tools/netlab/traces".to_owned());
    let mut rng = fastrand::Rng::with_seed(2026);

    // A slow swing between good and bad cover, times a random walk of fading in decibels that is drawn back to 0.
    let mut fading_db = 0.0;
    let lte: Vec<f64> = (0..240)
        .map(|n| {
            let seconds = f64::from(n) * 0.5;
            fading_db = 0.85 * fading_db + (rng.f64() * 2.0 - 1.0) * 1.5;
            let cover_db = 4.0 * (std::f64::consts::TAU * seconds / 47.0).sin();
            let handover = (60.0..61.5).contains(&seconds);
            if handover {
                0.0
            } else {
                6000.0 * 10.0_f64.powf((cover_db + fading_db) / 10.0)
            }
        })
        .collect();
    write(
        &folder,
        "lte-walk.csv",
        "a walk in a city on LTE, two minutes: 6000 kbit/s * 10^((4 dB * sin(2 pi t / 47 s) + f) / 10),\n\
         # f each 500 ms 0.85 of what it was plus a uniform draw from +-1.5 dB; a handover without any service from 60 s to 61.5 s",
        500,
        &lte,
    )?;

    // A share of the air that changes with the number of other senders.
    let mut others = 2_u32;
    let wifi: Vec<f64> = (0..600)
        .map(|_| {
            match rng.u32(0..20) {
                0..=2 => others = (others + 1).min(12),
                3..=5 => others = others.saturating_sub(1),
                _ => {}
            }
            let collision = if rng.f64() < 0.02 * f64::from(others) {
                0.1
            } else {
                1.0
            };
            collision * 24_000.0 / f64::from(1 + others)
        })
        .collect();
    write(
        &folder,
        "wifi-busy.csv",
        "a busy wireless LAN, one minute: 24000 kbit/s / (1 + n), n others (0 to 12, 2 at first) each 100 ms\n\
         # one more or one fewer with 15 % chance each; with a chance of 2 % * n only a tenth of it, for collisions",
        100,
        &wifi,
    )?;

    let steps: Vec<f64> = [
        2000.0, 1000.0, 500.0, 250.0, 200.0, 120.0, 60.0, 0.0, 2000.0,
    ]
    .iter()
    .flat_map(|&kbit_s| std::iter::repeat_n(kbit_s, if kbit_s == 0.0 { 3 } else { 10 }))
    .collect();
    write(
        &folder,
        "step-down.csv",
        "ten seconds each of 2000, 1000, 500, 250, 200, 120 and 60 kbit/s, three of nothing, ten of 2000 again",
        1000,
        &steps,
    )
}

fn write(
    folder: &str,
    name: &str,
    what: &str,
    step_ms: usize,
    kbit_s: &[f64],
) -> std::io::Result<()> {
    let mut text = format!(
        "# SYNTHETIC, not measured: made by `cargo run -p netlab --example make_traces`.\n# {what}\nms,kbit/s\n"
    );
    for (index, kbit_s) in kbit_s.iter().enumerate() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{},{kbit_s:.0}", index * step_ms);
    }
    std::fs::write(Path::new(folder).join(name), text)
}
