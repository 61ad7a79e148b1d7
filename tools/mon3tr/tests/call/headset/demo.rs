//! `mon3tr demo --display xr` where no runtime is active: it brings a Monado of its own, and leaves nothing of it.

use crate::command::{Outcome, json};
use crate::house::{count, wait_for};
use crate::place::{Demo, Place, can_draw, fails_naming, kill, wait_for_receiver};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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

/// `demo --display xr` for so many frames.
fn in_headset(place: &Place, frames: u32) -> Command {
    place.demo(&["--display", "xr", "--frames", &frames.to_string()])
}

#[test]
fn a_demo_that_is_asked_to_end_takes_its_processes_and_folders_along() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let mut demo = in_headset(&place, 100_000);
    let said = place.file("said");
    demo.stdout(Stdio::null())
        .stderr(File::create(&said).expect("a file"));
    let mut demo = Demo::start(&mut demo);
    wait_for_receiver(&mut demo, &said);
    assert!(place.processes().len() >= 5, "and itself");
    demo.ask_to_end();
    fails_naming(&mut demo, &said, &["stopped before the end"]);
    place.assert_left_clean();
}

#[test]
fn a_demo_that_is_killed_takes_its_processes_along() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let mut demo = in_headset(&place, 100_000);
    demo.stdout(Stdio::null()).stderr(Stdio::null());
    let mut demo = Demo::start(&mut demo);
    wait_for("five processes", || {
        (place.processes().len() >= 5).then_some(())
    });
    demo.kill();
    wait_for("its end", || demo.has_ended());
    wait_for("the end of all processes", || {
        place.processes().is_empty().then_some(())
    });
}

#[test]
fn a_demo_whose_monado_dies_says_so_at_once_and_ends() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let (mut demo, said) = (in_headset(&place, 100_000), place.file("said"));
    demo.stdout(Stdio::null())
        .stderr(File::create(&said).expect("a file"));
    let mut demo = Demo::start(&mut demo);
    wait_for_receiver(&mut demo, &said);
    kill(&place, "monado-service");
    let named = ["Monado has ended by itself", "signal: 9"];
    fails_naming(&mut demo, &said, &named);
    place.assert_left_clean();
}

#[test]
fn the_demo_in_a_headset_leaves_both_eyes_pictures_and_the_sessions_figures_and_no_process() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let shown = Outcome::of(&mut in_headset(&place, 60)).succeeds();

    let figures = json(&place.file("figures.json"));
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
        let picture = image::open(place.file("pictures").join(name));
        let picture = picture.unwrap_or_else(|why| panic!("{name}: {why}"));
        let colours = picture.into_rgb8();
        let dark = colours.pixels().filter(|pixel| pixel.0[0] < 120).count();
        assert!(dark > 500, "{name} shows nobody: {dark} dark pixels");
    }
    place.assert_left_clean();
}
