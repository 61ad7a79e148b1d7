//! `mon3tr profile` whole: a call of the small made-up person, and everything that it writes.

use crate::support::{json, mon3tr, puppet, text};
use test_support::onnx::runtime;
use test_support::vulkan::gpu;

#[test]
fn profile_holds_a_call_and_writes_figures_a_trace_and_a_page_that_agree() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    let file = |name: &str| folder.path().join("out").join(name);
    let (figures, trace, page) = (file("p.json"), file("t.json"), file("p.html"));
    let shown = mon3tr(&[
        "profile",
        text(&package),
        "--seconds",
        "1.5",
        "--size",
        "96x64",
        "--display-hz",
        "50",
        "--json",
        text(&figures),
        "--trace",
        text(&trace),
        "--page",
        text(&page),
    ])
    .succeeds();
    let figures = json(&figures);
    let measured = &figures["measured"];
    for row in measured["stages"].as_array().expect("a list of stages") {
        let name = row["stage"].as_str().expect("a name");
        assert!(shown.contains(name), "{name} is in the table:\n{shown}");
    }
    let pictures = measured["pictures"]["shown"].as_u64().expect("a count");
    assert!(pictures > 0, "something was shown:\n{shown}");
    let latency = &measured["latency"];
    let mean = |of: &serde_json::Value| of["mean_ms"].as_f64().expect("a mean");
    let parts = latency["parts"].as_array().expect("parts");
    let sum: f64 = parts.iter().map(mean).sum();
    let whole = mean(&latency["whole"]);
    assert!(
        (sum - whole).abs() < 1e-6,
        "parts of {sum} ms make {whole} ms"
    );
    assert!(
        figures["sent"]["encode_ns"].as_u64() > Some(0),
        "the sender has told what encoding takes"
    );
    let machine = &figures["machine"];
    let times = machine["at_s"].as_array().expect("times");
    let [series, absent] = ["series", "absent"].map(|of| machine[of].as_array().expect("a list"));
    assert!(
        !times.is_empty() && series.len() + absent.len() > 0,
        "the machine was asked, and told something or did not: {machine}"
    );
    for one in series {
        let values = one["values"].as_array().expect("values");
        assert_eq!(values.len(), times.len(), "one for each time: {one}");
    }
    let trace = json(&trace);
    let events = trace["traceEvents"].as_array().expect("events");
    let blanks = events.iter().filter(|event| event["ph"] == "i").count();
    assert_eq!(
        blanks as u64, pictures,
        "the trace has each picture's blank"
    );
    let page = std::fs::read_to_string(page).expect("the page");
    assert!(
        page.contains("\"controllers\":") && !page.contains("/*DATA*/"),
        "the page has figures"
    );
}
