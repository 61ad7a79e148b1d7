//! The traces that come with the crate.

use std::{path::Path, time::Duration};

use netlab::Trace;

#[test]
fn the_traces_that_come_with_the_crate_are_good_and_say_that_they_are_synthetic() {
    for (name, seconds, kbit_s) in [
        ("lte-walk.csv", 120, 3000.0..15_000.0),
        ("wifi-busy.csv", 60, 1500.0..12_000.0),
        ("step-down.csv", 83, 500.0..1000.0),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("traces")
            .join(name);
        let trace = Trace::read(&path).expect("a good trace");
        assert_eq!(trace.period(), Duration::from_secs(seconds), "{name}");
        assert!(
            kbit_s.contains(&trace.mean_kbit_s()),
            "{name}: {} kbit/s",
            trace.mean_kbit_s()
        );
        let text = std::fs::read_to_string(&path).expect("a file");
        assert!(text.starts_with("# SYNTHETIC, not measured"), "{name}");
    }
}

#[test]
fn a_missing_trace_is_named() {
    let error = Trace::read(Path::new("nowhere/x.csv")).expect_err("no such file");
    assert_eq!(
        error.to_string(),
        "cannot read the trace nowhere/x.csv",
        "the message"
    );
}
