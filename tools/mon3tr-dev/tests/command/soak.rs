//! `mon3tr-dev soak`: a short one.

use crate::support::{json, mon3tr, puppet, text};
use serde_json::Value;
use test_support::monado::{Compositor, Driver, Monado};
use test_support::{onnx, vulkan};

/// What each line of the table of samples has a value of, but while the headset is away.
const COUNTED: [&str; 5] = [
    "serve_resident_bytes",
    "send_threads",
    "receive_descriptors",
    "device_bytes",
    "latency_p99_ms",
];

/// Samples in 36 s, every two seconds; a busy machine may miss some.
const FEWEST: usize = 12;

#[test]
fn a_call_is_looked_at_from_outside_while_its_runtime_is_killed_twice() {
    let (Some(_), Some(_), Some(_)) = (
        // With the validation layer.
        vulkan::gpu(),
        onnx::runtime(),
        Monado::place(Driver::Simulated, Compositor::Null),
    ) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let package = puppet(&folder);
    let out = folder.path().join("soak");
    let call = ["soak", "--minutes", "0.6", "--avatar", text(&package)];
    let outcome = mon3tr(&[&call[..], &["--out", text(&out)]].concat());

    // Whether so short a call stays as it was is chance, what is told of it is not.
    let rows = json(&out.join("soak.json"))["rows"].as_array().cloned();
    let rows = rows.expect("a list of rows");
    let failing = rows.iter().filter(|row| row["good"] == false).count();
    if failing == 0 {
        outcome.succeeds();
    } else {
        outcome.fails_naming(&[&format!("{failing} lines")]);
    }
    let row = |of: &str, what: &str| {
        let found = rows
            .iter()
            .find(|row| row["of"] == of && row["what"] == what);
        found.unwrap_or_else(|| panic!("no row of {what} of {of}: {rows:#?}"))
    };
    for (what, wanted) in [
        ("validation messages", 0.0),
        ("headset opened, times", 3.0),
        ("connections with the sender", 1.0),
    ] {
        let row = row("receive", what);
        assert_eq!(row["last"].as_f64(), Some(wanted), "{row:#}");
        assert_eq!(row["good"], true, "{row:#}");
    }
    for of in ["serve", "send", "receive"] {
        for what in ["resident memory, MB", "descriptors", "threads"] {
            let row = row(of, what);
            let is_known = |key: &str| row[key].as_f64().is_some_and(|value| value > 0.0);
            assert!(is_known("first") && is_known("last"), "{row:#}");
        }
    }
    assert_samples(
        &std::fs::read_to_string(out.join("samples.csv")).expect("samples"),
        &rows,
    );
}

fn assert_samples(table: &str, rows: &[Value]) {
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let heading = lines.next().expect("a heading");
    let column = |name: &str| {
        let found = heading.iter().position(|one| *one == name);
        found.unwrap_or_else(|| panic!("no column {name} in {heading:?}"))
    };
    let samples: Vec<_> = lines.collect();
    assert!(
        samples.len() >= FEWEST,
        "{} samples of {rows:#?}",
        samples.len()
    );
    for name in COUNTED {
        let column = column(name);
        let values = samples
            .iter()
            .filter_map(|line| line[column].parse::<f64>().ok());
        let known = values.filter(|value| *value > 0.0).count();
        assert!(known > FEWEST / 2, "{known} values of {name}:\n{table}");
    }
    let runtime = column("runtime");
    let away = samples.iter().filter(|line| line[runtime] == "0").count();
    assert!(away >= 1, "the runtime was away {away} times:\n{table}");
}
