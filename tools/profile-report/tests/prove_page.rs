//! `android/prove-page.py` on what `android/prove.sh --rehearsal --short` once left (`tests/proved`): what it judges, and what it says where something is
//! missing, failed or broken.
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A copy of the recorded folder.
struct Proof(TempDir);

/// The rows of a page: verdict, claim and what was measured, as they are printed.
struct Rows {
    status: Option<i32>,
    said: String,
    page: String,
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("the recorded folder") {
        let entry = entry.expect("an entry");
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).expect("copied");
        }
    }
}

impl Proof {
    fn recorded() -> Self {
        let new = Self(tempfile::tempdir().expect("a temporary folder"));
        let recorded = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/proved");
        copy(&recorded, new.0.path());
        new
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Another text in a file; an empty one is replaced as a whole.
    fn replace(&self, name: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(name)).expect(name);
        assert!(text.contains(from), "{name} has {from:?}:\n{text}");
        fs::write(self.path(name), text.replace(from, to)).expect("written");
    }

    fn rows(&self) -> Rows {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../android/prove-page.py");
        let output = Command::new("python3")
            .arg(script)
            .arg(self.0.path())
            .output()
            .expect("python3 runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Rows {
            status: output.status.code(),
            said: text(&output.stdout) + &text(&output.stderr),
            page: fs::read_to_string(self.path("proof.html")).unwrap_or_default(),
        }
    }
}

impl Rows {
    /// Asserts the verdict of the claim, and words of what was measured.
    fn expect(&self, verdict: &str, claim: &str, words: &str) {
        let row = self.said.lines().find(|line| line.contains(claim));
        let row = row.unwrap_or_else(|| panic!("no row of {claim}:\n{}", self.said));
        assert!(
            row.starts_with(verdict) && row.contains(words),
            "{verdict}, {words}, but: {row}"
        );
    }
}

#[test]
fn a_recorded_proof_is_judged_row_by_row() {
    let rows = Proof::recorded().rows();
    assert_eq!(rows.status, Some(0), "{}", rows.said);
    rows.expect("held", "The parts of the latency add up", "1 profiles");
    rows.expect("held", "Placement cpu on xnnpack", "5 nodes on Xnnpack");
    rows.expect("not tried", "Placement npu on qnn", "left out by --short");
    rows.expect("held", "People seen at once: 2", "frames taken of each");
    rows.expect("not tried", "... at the display's rate: 1", "llvmpipe");
    rows.expect("held", "In a pause the call goes on", "joined 1 times");
    rows.expect("held", "the wearer is seen", "frames of motion");
    rows.expect("held", "... and heard", "packets of voice");
    rows.expect(
        "not tried",
        "A lost packet loses its own frame",
        "not built",
    );
    rows.expect("not tried", "It does not get too hot", "says nothing");
    let printed = rows.said.lines().take_while(|line| !line.is_empty());
    assert_eq!(
        rows.page.matches("<tr><td>").count(),
        printed.count(),
        "each row is on the page"
    );
    assert!(
        !rows.page.contains("src=") && !rows.page.contains("<link"),
        "the page loads nothing"
    );
}

#[test]
fn a_headsets_own_gpu_is_judged_by_its_speed() {
    let proof = Proof::recorded();
    let profile = "profile/cpu,npu=xnnpack/profile.json";
    proof.replace(profile, "llvmpipe", "Adreno (TM) 740");
    for step in fs::read_dir(proof.path("log")).expect("logs") {
        let step = step.expect("a log").path();
        let text = fs::read_to_string(&step).expect("a log");
        fs::write(&step, text.replace("llvmpipe", "Adreno (TM) 740")).expect("written");
    }
    let rows = proof.rows();
    assert_eq!(rows.status, Some(1), "{}", rows.said);
    rows.expect(
        "did not hold",
        "Pictures keep the display's rate",
        "a second",
    );
    rows.expect("did not hold", "... at the display's rate: 1", "a second");
}

#[test]
fn a_step_that_failed_is_a_row_with_its_reason() {
    let proof = Proof::recorded();
    proof.replace("steps.tsv", "people-2\tdone", "people-2\tfailed");
    let steps = fs::read_to_string(proof.path("steps.tsv")).expect("steps");
    let failed: Vec<String> = (steps.lines())
        .map(|line| match line.split_once("people-2\tfailed") {
            Some(_) => format!("{}the app ended", line.trim_end_matches("done")),
            None => line.to_owned(),
        })
        .collect();
    fs::write(proof.path("steps.tsv"), failed.join("\n")).expect("written");
    let rows = proof.rows();
    assert_eq!(rows.status, Some(1), "{}", rows.said);
    rows.expect("did not hold", "People seen at once: 2", "the app ended");
    rows.expect("held", "People seen at once: 1", "frames taken");
}

#[test]
fn heat_growth_errors_and_broken_files_are_found() {
    let proof = Proof::recorded();
    let samples: String = (0..40)
        .map(|k| {
            format!(
                "{}\thour\t{}\t41.5\t{}\n",
                k * 5,
                k / 10,
                500_000 + k * 5_000
            )
        })
        .collect();
    fs::write(proof.path("samples.tsv"), samples).expect("written");
    proof.replace("steps.tsv", "hour\tskipped", "hour\tdone");
    let log = "11-28 11:00:00.000 1 2 E mon3tr  : the GPU is gone\n";
    fs::write(proof.path("log/call.txt"), log).expect("written");
    fs::write(proof.path("profile/cpu,npu=xnnpack/profile.json"), "[1]").expect("written");
    let rows = proof.rows();
    assert_eq!(rows.status, Some(1), "{}", rows.said);
    rows.expect("did not hold", "It does not get too hot", "status 3 of 6");
    rows.expect("did not hold", "memory does not grow", "40 readings");
    rows.expect("did not hold", "No panic, no error", "the GPU is gone");
    rows.expect("did not hold", "Placement cpu on xnnpack", "not understood");
}

#[test]
fn more_lost_frames_than_packets_do_not_hold() {
    for (lost, verdict) in [(270, "held"), (700, "did not hold")] {
        let proof = Proof::recorded();
        proof.replace("steps.tsv", "loss\tskipped", "loss\tdone");
        let steps = fs::read_to_string(proof.path("steps.tsv")).expect("steps");
        let steps = steps.replace("mon3tr-dev is not built", "");
        fs::write(proof.path("steps.tsv"), steps).expect("written");
        let log =
            format!("a call of 180 s: 5130 frames taken, {lost} lost, 13.2 kbit/s of payload\n");
        fs::write(proof.path("log/loss.txt"), log).expect("written");
        let rows = proof.rows();
        rows.expect(
            verdict,
            "A lost packet loses its own frame",
            "5 % of the packets",
        );
    }
}

#[test]
fn a_proof_that_ended_at_its_begin_has_no_row_that_held() {
    let proof = Proof(tempfile::tempdir().expect("a temporary folder"));
    let rows = proof.rows();
    assert_eq!(rows.status, Some(1), "{}", rows.said);
    rows.expect("not tried", "People seen at once: 4", "ended before");
}
