//! `mon3tr demo --display xr` where no runtime is active: it brings a Monado of its own, and leaves nothing of it.

use super::can_draw;
use crate::command::{Outcome, command, json, text};
use crate::house::{count, wait_for};
use mon3tr_tests::synthetic::Puppet;
use reconstruct::bake::BAKE_VERSION;
use std::path::{Path, PathBuf};

/// Whether Monado's programs are there, and no other runtime is; on CI both must be so.
fn monado_alone() -> bool {
    let there = std::env::var_os("MON3TR_MONADO").is_some_and(|one| PathBuf::from(one).is_dir());
    let active = ["/etc/xdg", "/etc", "/usr/local/etc", "/usr/share"]
        .iter()
        .any(|folder| {
            Path::new(folder)
                .join("openxr/1/active_runtime.json")
                .exists()
        });
    let why = match (there, active) {
        (true, false) => return true,
        (false, _) => "MON3TR_MONADO does not name a Monado's folder",
        (true, true) => "another OpenXR runtime is active on this machine",
    };
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "no Monado: {why}"
    );
    println!("skipped: no Monado: {why}");
    false
}

/// Processes that have `mark` in their environment.
fn processes_with(mark: &str) -> Vec<String> {
    let all = std::fs::read_dir("/proc").expect("Linux");
    let all = all.filter_map(|entry| Some(entry.ok()?.path()));
    let ours = all.filter(|process| {
        // Others' cannot be read, and some end meanwhile.
        let environment = std::fs::read(process.join("environ")).unwrap_or_default();
        String::from_utf8_lossy(&environment).contains(mark)
    });
    let command = |process: PathBuf| {
        let line = std::fs::read(process.join("cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&line).replace('\0', " ")
    };
    // One that has ended and is not waited for yet has neither.
    ours.map(command).filter(|line| !line.is_empty()).collect()
}

#[test]
fn the_demo_in_a_headset_leaves_both_eyes_pictures_and_the_sessions_figures_and_no_process() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name);
    // The bake has a test of its own: where the demo person would lie in the cache lies a puppet.
    let avatar = file(&format!("avatars/demo-20000-v{BAKE_VERSION}.m3a"));
    for made in ["avatars", "tmp", "config"] {
        std::fs::create_dir(file(made)).expect("a folder");
    }
    Puppet::small().avatar().save(&avatar).expect("a puppet");
    let (out, figures, places) = (file("pictures"), file("figures.json"), file("tmp"));
    let mut demo = command(&["demo", "--display", "xr", "--frames", "60"]);
    demo.args(["--gaussians", "20k", "--size", "480x360"])
        .args(["--out", text(&out), "--json", text(&figures)])
        .env("MON3TR_CACHE", folder.path())
        // All that is temporary, and whose processes these are.
        .env("TMPDIR", &places)
        .env("XDG_CONFIG_HOME", file("config"))
        .env_remove("XR_RUNTIME_JSON")
        .env_remove("XDG_RUNTIME_DIR");
    let shown = Outcome::of(&mut demo).succeeds();

    let figures = json(&figures);
    let headset = &figures["headset"];
    assert_eq!(count(&headset["frames"], "shown"), 60, "{headset:#}");
    assert_eq!(count(headset, "opened"), 1, "{headset:#}");
    let runtime = headset["runtime"].as_str().unwrap_or_default();
    assert!(runtime.contains("Monado"), "{runtime}");
    for (list, least) in [("states", 10), ("granted", 3), ("missing", 3)] {
        let long = headset[list].as_array().map(Vec::len);
        assert!(long >= Some(least), "{list}: {headset:#}");
    }
    for word in ["states     idle ready", "granted    XR_", "missing    XR_"] {
        assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
    }
    for name in ["left.png", "right.png", "stereo.png", "moments.png"] {
        let picture = image::open(out.join(name));
        let picture = picture.unwrap_or_else(|why| panic!("{name}: {why}"));
        let colours = picture.into_rgb8();
        let dark = colours.pixels().filter(|pixel| pixel.0[0] < 120).count();
        assert!(dark > 500, "{name} shows nobody: {dark} dark pixels");
    }
    let mark = format!("TMPDIR={}", text(&places));
    wait_for("the end of all processes", || {
        let left = processes_with(&mark);
        left.is_empty().then_some(())
    });
    let left = std::fs::read_dir(&places).expect("the folder").flatten();
    // ONNX Runtime leaves a file of its own for its next session.
    let left: Vec<_> = left.map(|entry| entry.file_name()).collect();
    let left: Vec<_> = left.iter().filter(|name| *name != ".ses").collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}
