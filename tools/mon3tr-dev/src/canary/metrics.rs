//! The results of the last calls as Prometheus' text, for the textfile collector of node_exporter.

use super::call::Arrived;
use super::{Call, Outcome};
use anyhow::Context;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use tempfile::NamedTempFile;

/// Name, and what it says.
const FAMILIES: [(&str, &str); 6] = [
    ("up", "Whether the last call through the server succeeded."),
    ("failed", "The step in which the last call failed."),
    (
        "relay",
        "Whether the server names a relay that lends an address.",
    ),
    ("join_seconds", "From joining to the first frame of motion."),
    (
        "frames_lost_ratio",
        "Share of the motion frames that did not arrive.",
    ),
    ("finished_timestamp_seconds", "When the last call ended."),
];

/// Writes the file as a whole: the collector never reads a part of it.
pub(super) fn write(path: &Path, calls: &[Call]) -> anyhow::Result<()> {
    let cannot = || format!("cannot write {}", path.display());
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let mut file = NamedTempFile::new_in(folder.unwrap_or(Path::new("."))).with_context(cannot)?;
    file.write_all(text(calls).as_bytes())
        .with_context(cannot)?;
    // The collector is another user.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let readable = std::fs::Permissions::from_mode(0o644);
        file.as_file()
            .set_permissions(readable)
            .with_context(cannot)?;
    }
    file.persist(path).with_context(cannot)?;
    Ok(())
}

fn text(calls: &[Call]) -> String {
    let mut text = String::new();
    for (name, help) in FAMILIES {
        let _ = writeln!(text, "# HELP mon3tr_canary_{name} {help}");
        let _ = writeln!(text, "# TYPE mon3tr_canary_{name} gauge");
        for call in calls {
            for (labels, value) in samples(name, call) {
                let server = escaped(&call.server);
                let _ = writeln!(
                    text,
                    "mon3tr_canary_{name}{{server=\"{server}\"{labels}}} {value}"
                );
            }
        }
    }
    text
}

/// Labels besides the server's, and values of one family.
fn samples(family: &str, call: &Call) -> Vec<(String, f64)> {
    let paths = |value: fn(&Arrived) -> f64| match &call.outcome {
        Outcome::Failed(_) => Vec::new(),
        Outcome::Succeeded(measured) => [
            ("direct", Some(measured.direct)),
            ("forwarded", measured.forwarded),
        ]
        .into_iter()
        .filter_map(|(path, arrived)| Some((format!(",path=\"{path}\""), value(&arrived?))))
        .collect(),
    };
    let alone = |value: f64| vec![(String::new(), value)];
    match (family, &call.outcome) {
        ("up", outcome) => alone(f64::from(u8::from(matches!(
            outcome,
            Outcome::Succeeded(_)
        )))),
        ("failed", Outcome::Failed(failure)) => {
            vec![(format!(",step=\"{}\"", failure.step), 1.0)]
        }
        ("relay", Outcome::Succeeded(measured)) => {
            alone(f64::from(u8::from(measured.relay.is_some())))
        }
        ("join_seconds", _) => paths(|arrived| arrived.join_s),
        ("frames_lost_ratio", _) => {
            paths(|arrived| arrived.lost as f64 / arrived.frames.max(1) as f64)
        }
        ("finished_timestamp_seconds", _) => alone(call.finished as f64),
        _ => Vec::new(),
    }
}

/// A label's value, as the text format has it.
fn escaped(value: &str) -> String {
    value
        .replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use super::super::call::Measured;
    use super::super::failure::{Failure, Step};
    use super::*;

    #[test]
    fn a_success_and_a_failure_are_two_servers_of_each_family() {
        let arrived = |join_s| Arrived {
            join_s,
            frames: 40,
            lost: 10,
        };
        let measured = Measured {
            direct: arrived(0.5),
            relay: None,
            forwarded: Some(arrived(1.5)),
        };
        let call = |server: &str, outcome| Call {
            server: server.to_owned(),
            finished: 1_700_000_000,
            outcome,
        };
        let failure = Failure::new(Step::FirstFrame, "nothing arrives");
        let text = text(&[
            call("https://a", Outcome::Succeeded(measured)),
            call("https://b", Outcome::Failed(failure)),
        ]);
        for line in [
            "mon3tr_canary_up{server=\"https://a\"} 1",
            "mon3tr_canary_up{server=\"https://b\"} 0",
            "mon3tr_canary_failed{server=\"https://b\",step=\"first frame\"} 1",
            "mon3tr_canary_join_seconds{server=\"https://a\",path=\"forwarded\"} 1.5",
            "mon3tr_canary_frames_lost_ratio{server=\"https://a\",path=\"direct\"} 0.25",
            "mon3tr_canary_finished_timestamp_seconds{server=\"https://b\"} 1700000000",
            "# TYPE mon3tr_canary_up gauge",
        ] {
            assert!(text.lines().any(|one| one == line), "no {line} in:\n{text}");
        }
    }
}
