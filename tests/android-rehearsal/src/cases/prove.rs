//! `android/prove.sh` on the rehearsal: each of its steps, for seconds.

use super::{Figures, figure};
use crate::device;
use crate::environment::Environment;
use anyhow::{Context, ensure};
use std::fs;
use std::path::Path;
use std::process::Command;
use test_support::monado::Compositor;

/// Claims that are judged without a headset, by the first words of their rows.
const HELD: [&str; 7] = [
    "The parts of the latency add up",
    "Placement cpu on xnnpack",
    "People seen at once: 2",
    "In a pause the call goes on",
    "In a call of several the wearer is seen",
    "... and heard",
    "What a call takes of the network",
];

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let (out, said) = (scene.folder.join("proof"), scene.folder.join("said"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../android/prove.sh");
    let mut command = Command::new(script);
    command
        .args(["--rehearsal", "--short", "--out"])
        .arg(&out)
        .stdout(fs::File::create(&said)?);
    let has_network = scene.program("mon3tr-dev").is_some();
    let status = device::execute(scene, &mut command)?;
    let said = fs::read_to_string(&said)?;
    ensure!(status.success(), "{status}:\n{said}");
    // The network that loses packets is mon3tr-dev's, which the whole rehearsal has built.
    let lossy = has_network.then_some("A lost packet loses its own frame alone");
    for claim in HELD.into_iter().chain(lossy) {
        let row = said.lines().find(|line| line.contains(claim));
        let row = row.with_context(|| format!("there is no row of \"{claim}\":\n{said}"))?;
        ensure!(row.starts_with("held"), "{row}");
    }
    let page = fs::read_to_string(out.join("proof.html"))?;
    let mut figures = Figures::new();
    figure(&mut figures, "rows", page.matches("<tr><td>").count());
    let held = said.lines().filter(|line| line.starts_with("held"));
    figure(&mut figures, "held", held.count());
    Ok(figures)
}
