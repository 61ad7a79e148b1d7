//! Table, trace and page of a made-up recording, each against an independent reference.

use crate::machine::MachineFigures;
use crate::synthetic::{Synthetic, synthetic};
use crate::{FINISHED, Folder, page, trace};
use app_pipeline::profile::Summary;
use app_pipeline::stage::Lane;
use serde_json::Value;
use std::collections::HashMap;
use std::process::Command;

fn traced(of: &Synthetic) -> Value {
    let mut text = Vec::new();
    let about = serde_json::json!({ "avatar": of.report.avatar.name });
    trace::write(
        &mut text,
        &of.recording,
        &of.terms,
        &of.report.machine,
        &about,
    )
    .expect("memory takes it");
    let text = String::from_utf8(text).expect("it is text");
    kept("trace.json", &text);
    serde_json::from_str(&text).expect("it is JSON")
}

fn number(event: &Value, key: &str) -> f64 {
    event[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} is a number in {event}"))
}

/// The rules of the Trace Event Format, from its description, not from the code that writes it.
fn check_format(trace: &Value) -> Vec<Value> {
    let events = trace["traceEvents"].as_array().expect("a list of events");
    for event in events {
        let phase = event["ph"].as_str().expect("every event has a phase");
        assert!(event["name"].is_string(), "every event has a name: {event}");
        assert!(
            event["pid"].is_u64() && event["tid"].is_u64(),
            "numbers: {event}"
        );
        match phase {
            "M" => assert!(
                matches!(
                    event["name"].as_str(),
                    Some("process_name" | "thread_name" | "thread_sort_index")
                ),
                "{event}"
            ),
            "X" => assert!(
                number(event, "ts").is_finite() && number(event, "dur") >= 0.0,
                "{event}"
            ),
            "i" => assert!(
                matches!(event["s"].as_str(), Some("t" | "p" | "g")),
                "{event}"
            ),
            "C" => {
                let values = event["args"].as_object().expect("counters have values");
                assert!(
                    !values.is_empty() && values.values().all(Value::is_number),
                    "{event}"
                );
            }
            "s" | "t" | "f" => assert!(event["id"].is_u64() && event["cat"].is_string(), "{event}"),
            _ => panic!("an unknown phase in {event}"),
        }
        assert!(
            phase == "M" || number(event, "ts").is_finite(),
            "a time: {event}"
        );
    }
    events.clone()
}

fn of_phase<'a>(events: &'a [Value], phase: &'a str) -> impl Iterator<Item = &'a Value> {
    events.iter().filter(move |event| event["ph"] == phase)
}

#[test]
fn a_trace_has_a_track_for_each_lane_and_slices_that_never_cross() {
    let of = synthetic(2.0);
    let events = check_format(&traced(&of));
    let mut names = HashMap::new();
    for event in of_phase(&events, "M").filter(|event| event["name"] == "thread_name") {
        names.insert(
            event["tid"].as_u64(),
            event["args"]["name"].as_str().map(str::to_owned),
        );
    }
    for lane in Lane::ALL {
        let named = names
            .values()
            .filter(|name| name.as_deref() == Some(lane.name()));
        assert_eq!(named.count(), 1, "one track of {}", lane.name());
    }
    let mut tracks: HashMap<u64, Vec<(f64, f64)>> = HashMap::new();
    for event in of_phase(&events, "X") {
        let (ts, dur) = (number(event, "ts"), number(event, "dur"));
        let track = event["tid"].as_u64().expect("a track");
        tracks.entry(track).or_default().push((ts, ts + dur));
    }
    assert_eq!(tracks.len(), Lane::ALL.len(), "every lane works");
    for (track, mut slices) in tracks {
        slices.sort_by(|a, b| a.0.total_cmp(&b.0));
        for two in slices.windows(2) {
            // Less than the nanosecond that microseconds are written to.
            assert!(two[1].0 > two[0].1 - 5e-4, "track {track}: {two:?} cross");
        }
    }
    assert_eq!(
        of_phase(&events, "X").count(),
        of.recording.spans.len(),
        "every span is there"
    );
    assert_eq!(
        of_phase(&events, "i").count(),
        of.recording.pictures.len(),
        "every blank is there"
    );
    assert!(
        of_phase(&events, "C").count() > of.recording.pictures.len(),
        "and counters"
    );
}

#[test]
fn arrows_begin_and_end_once_within_slices_and_go_forward() {
    let of = synthetic(2.0);
    let events = check_format(&traced(&of));
    let slices: Vec<_> = of_phase(&events, "X").collect();
    let mut arrows: HashMap<u64, Vec<&Value>> = HashMap::new();
    for event in events.iter().filter(|event| event["cat"] == "way") {
        arrows
            .entry(event["id"].as_u64().expect("an id"))
            .or_default()
            .push(event);
    }
    let mut to_pictures = 0;
    for (id, steps) in &arrows {
        let phases: String = steps
            .iter()
            .filter_map(|step| step["ph"].as_str())
            .collect();
        let middle = phases.trim_matches(['s', 'f']);
        assert!(
            phases.starts_with('s')
                && phases.ends_with('f')
                && middle.chars().all(|c| c == 't')
                && middle.len() == phases.len() - 2,
            "arrow {id} is {phases}"
        );
        if phases.len() > 2 && steps[0]["name"] == "state to picture" {
            // What a picture was made of is above it: by the numbers that slices carry, not by how they were found.
            let around = |step: &Value| {
                let ts = number(step, "ts");
                let mut slices = slices.iter();
                let slice = slices.find(|slice| {
                    let begin = number(slice, "ts");
                    slice["tid"] == step["tid"] && begin <= ts && ts <= begin + number(slice, "dur")
                });
                slice.and_then(|slice| slice["args"]["frame"].as_u64())
            };
            let [interpolated, drawn] = [1, 2].map(|k| around(steps[k]).expect("a slice"));
            let repeated = drawn % 97 == 0;
            assert_eq!(interpolated, drawn - u64::from(repeated), "arrow {id}");
        }
        for two in steps.windows(2) {
            assert!(
                number(two[0], "ts") <= number(two[1], "ts"),
                "arrow {id} goes back: {two:?}"
            );
            assert_eq!(two[0]["name"], two[1]["name"], "or it would be two arrows");
        }
        for step in steps {
            let ts = number(step, "ts");
            let around = slices.iter().filter(|slice| {
                let begin = number(slice, "ts");
                slice["tid"] == step["tid"] && begin <= ts && ts <= begin + number(slice, "dur")
            });
            assert_eq!(around.count(), 1, "{step} lies in one slice");
        }
        to_pictures += usize::from(steps[0]["name"] == "state to picture");
    }
    // All but those at the edges, whose beginnings were before the measuring.
    let pictures = of.recording.pictures.len();
    assert!(
        to_pictures + 12 > pictures,
        "{to_pictures} of {pictures} pictures have an arrow"
    );
}

#[test]
fn the_table_fits_a_terminal_and_says_every_stage() {
    let of = synthetic(3.0);
    let table = of.report.table();
    println!("{table}");
    for line in table.lines() {
        assert!(
            line.chars().count() <= 110,
            "{} columns: {line}",
            line.chars().count()
        );
    }
    for row in &of.report.shown.measured.stages {
        assert!(
            table.contains(row.stage.name()),
            "{} is missing",
            row.stage.name()
        );
    }
    assert!(table.contains("capture to display"), "{table}");
    let chosen: Vec<&str> = table
        .lines()
        .filter(|line| line.ends_with("<- chosen"))
        .collect();
    assert!(
        matches!(chosen.as_slice(), [one] if one.starts_with("npu on QNN")),
        "{chosen:?}"
    );
    let words: Vec<&str> = table.split_whitespace().collect();
    let table = words.join(" ");
    for refusal in [
        "not cpu-tail, gpu on QNN: the NPU takes the whole graph",
        "not gpu on CPU: the device has 41 MB left, and states of 60035 Gaussians need 46 MB there",
    ] {
        assert!(table.contains(refusal), "{refusal} is missing: {table}");
    }
}

/// Where a test leaves files for a person to look at.
fn kept(name: &str, text: &str) -> std::path::PathBuf {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tmp");
    std::fs::create_dir_all(&folder).expect("a folder for what tests leave");
    let file = folder.join(name);
    std::fs::write(&file, text).expect("it can be written");
    file
}

/// The DOM of a page in headless Chromium, if there is one.
fn browsed(file: &std::path::Path) -> Option<String> {
    let names = [
        "chromium",
        "chromium-browser",
        "google-chrome-stable",
        "google-chrome",
    ];
    for name in names {
        let output = Command::new(name)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--virtual-time-budget=4000",
                "--dump-dom",
            ])
            .arg(format!("file://{}", file.display()))
            .output();
        if let Ok(output) = output {
            return Some(String::from_utf8_lossy(&output.stdout).into_owned());
        }
    }
    // As the viewer in a browser is: an optional check, whatever CI says.
    println!("skipped: there is no Chromium to show the page");
    None
}

/// Without a browser this at least shows that the script is one: a name that is declared twice leaves the page blank.
#[test]
fn the_pages_script_is_javascript() {
    let script = kept("profile.js", include_str!("page.js"));
    let Ok(checked) = Command::new("node").arg("--check").arg(&script).output() else {
        println!("skipped: there is no Node to parse the page's script");
        return;
    };
    assert!(
        checked.status.success(),
        "{}",
        String::from_utf8_lossy(&checked.stderr)
    );
}

#[test]
fn a_browser_draws_every_part_of_the_page() {
    let of = synthetic(10.0);
    let page = page::page(&of.report, &of.recording, &of.terms).expect("a page");
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
    let address = page
        .find("http")
        .map(|at| &page[at..(at + 60).min(page.len())]);
    assert!(
        address.is_none_or(|address| address.starts_with("http://www.w3.org/")),
        "it makes no requests: {address:?}"
    );
    let Some(drawn) = browsed(&kept("profile.html", &page)) else {
        return;
    };
    assert!(
        drawn.contains("data-drawn=\"all\""),
        "{}",
        drawn.get(..600).unwrap_or(&drawn)
    );
    assert!(
        drawn.contains("A made-up person &lt;/script&gt;"),
        "the avatar's name is text"
    );
    assert!(
        drawn.contains("&lt;skin&gt; (10)") && drawn.contains("Permission denied"),
        "what could be read, and what could not"
    );
}

#[test]
fn a_browser_draws_a_page_of_nothing() {
    let mut of = synthetic(1.0);
    of.recording.spans.clear();
    of.recording.pictures.clear();
    of.report.shown.measured = Summary::new(&of.recording, &of.terms);
    of.report.shown.placement.alternatives.clear();
    of.report.shown.placement.landing = None;
    of.report.sent = Value::Null;
    of.report.machine = MachineFigures::default();
    let table = of.report.table();
    assert!(!table.contains("NaN"), "{table}");
    let page = page::page(&of.report, &of.recording, &of.terms).expect("a page");
    let Some(drawn) = browsed(&kept("profile-empty.html", &page)) else {
        return;
    };
    assert!(
        drawn.contains("data-drawn=\"all\""),
        "{}",
        drawn.get(..600).unwrap_or(&drawn)
    );
}

#[test]
fn every_reading_of_the_machine_is_in_the_trace_at_its_time_and_a_gap_is_none() {
    let of = synthetic(10.0);
    let events = check_format(&traced(&of));
    let machine = &of.report.machine;
    // The first thing that happened is where the trace begins.
    let begin = of
        .recording
        .spans
        .first()
        .map_or(of.recording.begin, |span| {
            span.begin.min(of.recording.begin)
        });
    let offset = (of.recording.begin - begin).as_secs_f64();
    for series in &machine.series {
        let counted: Vec<(f64, f64)> = of_phase(&events, "C")
            .filter(|event| event["name"] == series.channel.name.as_str())
            .map(|event| {
                let values = event["args"].as_object().expect("values");
                let value = values.values().next().and_then(Value::as_f64);
                (number(event, "ts") / 1e6 - offset, value.expect("a number"))
            })
            .collect();
        let pairs = machine.at_s.iter().zip(&series.values);
        let read: Vec<(f64, f64)> = pairs.filter_map(|(at, v)| Some((*at, (*v)?))).collect();
        assert_eq!(counted.len(), read.len(), "{}", series.channel.name);
        for (got, wanted) in counted.iter().zip(read) {
            assert!(
                (got.0 - wanted.0).abs() < 1e-5 && got.1 == wanted.1,
                "{}: {got:?} is not {wanted:?}",
                series.channel.name
            );
        }
    }
    assert!(
        machine.series.iter().any(|one| one.values.contains(&None)),
        "a gap was tried"
    );
}

#[test]
fn the_table_shows_temperatures_and_what_could_not_be_read() {
    let table = synthetic(1.0).report.table();
    let words: Vec<&str> = table.split_whitespace().collect();
    let table = words.join(" ");
    for said in [
        "hottest cpu-0-0 (0), 48 to 58 °C",
        "CPU clocks 2016 to 3187 MHz",
        "GPU clock 492 to 492 MHz",
        "GPU throttling level 0 to 2",
        "not readable: GPU busy",
    ] {
        assert!(table.contains(said), "{said} is missing: {table}");
    }
}

#[test]
fn a_folder_is_finished_last_and_removes_an_earlier_profile() {
    let of = synthetic(1.0);
    let root = tempfile::tempdir().expect("a temporary folder");
    let path = root.path().join("files/profile");
    let read = |name: &str| std::fs::read_to_string(path.join(name));
    let folder = Folder::begin(&path).expect("a folder");
    folder
        .failed("no OpenXR runtime")
        .expect("the file is written");
    assert_eq!(
        read(FINISHED).expect("the file is written"),
        "failed: no OpenXR runtime\n",
        "why there is none"
    );
    let folder = Folder::begin(&path).expect("the same folder");
    assert!(read(FINISHED).is_err(), "an old end is no end");
    folder
        .write(&of.report, &of.recording, &of.terms)
        .expect("files");
    assert_eq!(
        read(FINISHED).expect("the file is written"),
        "ok\n",
        "it went well"
    );
    let figures: Value =
        serde_json::from_str(&read("profile.json").expect("figures")).expect("JSON");
    assert_eq!(figures["avatar"]["gaussians"], 60_035, "the avatar's");
    assert_eq!(
        figures["machine"]["series"][0]["values"][1], 48.5,
        "the machine's"
    );
    assert_eq!(
        read("profile.txt").expect("a table"),
        of.report.table(),
        "as printed"
    );
    check_format(&serde_json::from_str(&read("trace.json").expect("a trace")).expect("JSON"));
    assert!(
        read("profile.html")
            .expect("a page")
            .contains("cpu-0-0 (0)"),
        "the page"
    );
    let names = std::fs::read_dir(&path).expect("a folder").count();
    assert_eq!(names, 5, "and nothing else");
}
