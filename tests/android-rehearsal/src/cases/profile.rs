//! A measurement as `android/profile.sh` has the headset make it.

use super::{Figures, assert_well, figure};
use crate::environment::Environment;
use android_rehearsal::protocol::{Intent, PowerFigures};
use anyhow::{Context, ensure};
use serde_json::Value;
use std::fs;
use synthetic_person::{Puppet, PuppetSize};
use test_support::monado::Compositor;

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    fs::create_dir_all(scene.external())?;
    let person = Puppet::new(PuppetSize::FULL);
    person.avatar().save(&scene.external().join("avatar.m3a"))?;
    let mut process = scene.process()?;
    let activity = process.launch(Intent::default().with("profile", "5"))?;
    process.wait_for("the profile is written", 1)?;
    // The task is done: the app asks Android, once, to close it.
    process.wait_for("closing the app", 1)?;
    let finishes = process.census()?.java.finishes;
    ensure!(
        finishes == [[1, 0]],
        "asked to finish (by Java, natively): {finishes:?}"
    );
    assert_well(&mut process)?;
    ensure!(
        process.logged("the device is slightly throttled, by heat") == 1,
        "the log does not tell the thermal status once"
    );
    process.leave(activity)?;
    let power = process.census()?.power;
    process.quit()?;
    let folder = scene.external().join("profile");
    for file in [
        "finished",
        "profile.json",
        "profile.html",
        "profile.txt",
        "trace.json",
    ] {
        let length = fs::metadata(folder.join(file)).map_or(0, |file| file.len());
        ensure!(length > 0, "the profile has no {file}");
    }
    let read = |file: &str| -> anyhow::Result<Value> {
        let text = fs::read_to_string(folder.join(file))?;
        serde_json::from_str(&text).with_context(|| format!("{file} is no JSON"))
    };
    let (profile, trace) = (read("profile.json")?, read("trace.json")?);
    let runtime = profile["conditions"]["onnx_runtime"]
        .as_str()
        .unwrap_or_default();
    ensure!(
        runtime.starts_with(|first: char| first.is_ascii_digit()),
        "ONNX Runtime's version is {runtime:?}"
    );
    let plan = profile["placement"]["plan"].as_str();
    platform_was_told(&power, plan.unwrap_or_default())?;
    let series = profile["machine"]["series"].as_array();
    let heat = series
        .into_iter()
        .flatten()
        .find(|one| one["quantity"] == "headroom");
    ensure!(
        heat.is_some_and(|heat| heat["most"] == 62.5),
        "the profile's thermal headroom is {heat:?}"
    );
    let events = trace["traceEvents"].as_array().map_or(0, Vec::len);
    ensure!(events > 100, "the trace has only {events} events");
    let mut figures = Figures::new();
    figure(&mut figures, "onnx_runtime", runtime);
    figure(&mut figures, "trace_events", events);
    figure(&mut figures, "hints", power.reports);
    Ok(figures)
}

/// Headroom and hints were asked for as Android wants it, and all is given back.
fn platform_was_told(power: &PowerFigures, plan: &str) -> anyhow::Result<()> {
    ensure!(
        power.headrooms >= 3,
        "headroom is seldom asked for: {power:?}"
    );
    ensure!(power.hasty_headrooms == 0, "and too often: {power:?}");
    ensure!(
        power.sessions >= 1 && power.reports >= 5,
        "few hints: {power:?}"
    );
    // The loop's thread and each lane's that the placement has.
    let threads = match plan {
        "gpu-alone" => 1,
        "gpu" => 2,
        _ => 3,
    };
    ensure!(power.threads >= threads, "for few threads: {power:?}");
    ensure!(power.strangers == 0 && power.wrong == 0, "wrong: {power:?}");
    let left = [power.open_sessions, power.listeners, power.thermal_managers];
    ensure!(left == [0; 3], "not given back: {power:?}");
    Ok(())
}
