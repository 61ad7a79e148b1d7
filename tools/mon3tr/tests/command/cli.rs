//! The command as its users meet it: every sub-command's happy path on a small made-up person, and its most likely
//! mistakes, which must end with one line that says what to do.

use crate::support::{self, Outcome, json, mon3tr, puppet, text};
use std::path::PathBuf;
use tempfile::TempDir;
use test_support::onnx::runtime;
use test_support::vulkan::gpu;

/// A folder with the made-up person's package in it.
fn folder_with_package() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    (folder, package)
}

#[test]
fn help_names_every_sub_command() {
    let help = mon3tr(&["--help"]).succeeds();
    for name in ["demo", "bake", "inspect", "render", "serve", "profile"] {
        assert!(help.contains(name), "{name} is missing in:\n{help}");
    }
}

#[test]
fn a_mistyped_sub_command_is_refused() {
    mon3tr(&["rendr"]).fails_naming(&["rendr"]);
}

#[test]
fn inspect_shows_the_counts() {
    let (folder, package) = folder_with_package();
    let figures = folder.path().join("figures.json");
    let shown = mon3tr(&["inspect", text(&package), "--json", text(&figures)]).succeeds();
    assert!(
        shown.contains("2000"),
        "the number of Gaussians is missing in:\n{shown}"
    );
    assert_eq!(
        json(&figures)["figures"]["gaussians"],
        2000,
        "the JSON has the counts too"
    );
}

#[test]
fn inspect_refuses_what_is_no_package() {
    let (folder, package) = folder_with_package();
    mon3tr(&["inspect", text(&folder.path().join("nobody.m3a"))])
        .fails_naming(&["nobody.m3a: there is no such file", "mon3tr bake --out"]);
    mon3tr(&["inspect", text(folder.path())]).fails_naming(&["a folder"]);
    let stranger = folder.path().join("notes.m3a");
    std::fs::write(&stranger, "dear diary").expect("a file can be written");
    mon3tr(&["inspect", text(&stranger)]).fails_naming(&["notes.m3a"]);
    let bytes = std::fs::read(&package).expect("the package can be read");
    std::fs::write(&stranger, &bytes[..bytes.len() / 2]).expect("a file can be written");
    mon3tr(&["inspect", text(&stranger)]).fails_naming(&["notes.m3a"]);
}

#[test]
fn render_leaves_pictures_an_animation_and_figures() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    let (folder, package) = folder_with_package();
    let (out, figures) = (
        folder.path().join("pictures"),
        folder.path().join("figures.json"),
    );
    let arguments = [
        "render",
        text(&package),
        "--frames",
        "0..5",
        "--size",
        "96x128",
        "--out",
        text(&out),
    ];
    mon3tr(&[&arguments[..], &["--json", text(&figures)]].concat()).succeeds();
    let first = image::open(out.join("frame_00000.png"))
        .expect("a PNG")
        .to_rgb8();
    assert_eq!(first.dimensions(), (96, 128), "the size asked for");
    let last = image::open(out.join("frame_00004.png"))
        .expect("a PNG")
        .to_rgb8();
    assert_ne!(first, last, "the person must move");
    let animation = std::fs::read(out.join("animation.webp")).expect("the animation");
    assert_eq!(
        (&animation[..4], &animation[8..12]),
        (&b"RIFF"[..], &b"WEBP"[..]),
        "a WebP file"
    );
    assert!(animation.windows(4).any(|w| w == b"ANMF"), "with frames");

    let figures = json(&figures);
    let stages = figures["runs"][0]["stages"]
        .as_array()
        .expect("a list of stages");
    for (stage, unit) in [
        ("kinematics", "CPU"),
        ("interpolate", "CPU"),
        ("sort", "GPU"),
        ("raster", "GPU"),
    ] {
        let row = stages
            .iter()
            .find(|row| row["stage"] == stage)
            .expect("every stage has a row");
        assert_eq!(row["unit"], unit, "{stage}");
        assert_eq!(row["count"], 5, "{stage} is timed in every frame");
        assert!(
            row["p50_ms"].as_f64().is_some_and(|ms| ms >= 0.0),
            "{stage} has a time"
        );
    }
    assert_eq!(
        figures["avatar"]["gaussians"], 2000,
        "counts are in the figures"
    );
    for key in ["vulkan_device", "vulkan_driver", "onnx_runtime"] {
        assert!(
            figures[key].as_str().is_some_and(|s| !s.is_empty()),
            "{key} is in the figures"
        );
    }
}

#[test]
fn render_draws_both_eyes_from_two_places() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    let (folder, package) = folder_with_package();
    let out = folder.path().join("pictures");
    let arguments = [
        "render",
        text(&package),
        "--frames",
        "0..1",
        "--size",
        "128x128",
        "--stereo",
    ];
    mon3tr(&[&arguments[..], &["--view", "waist-up", "--out", text(&out)]].concat()).succeeds();
    let eye = |side: &str| {
        image::open(out.join(format!("frame_00000_{side}.png")))
            .expect("a PNG")
            .to_rgb8()
    };
    assert_ne!(eye("left"), eye("right"), "the eyes stand apart");
}

#[test]
fn render_explains_mistaken_options() {
    let (folder, package) = folder_with_package();
    let package = text(&package);
    mon3tr(&["render", "nobody.m3a"]).fails_naming(&["nobody.m3a"]);
    mon3tr(&["render", package, "--motion", "missing.bvh"]).fails_naming(&["missing.bvh"]);
    let stranger = folder.path().join("song.mp3");
    std::fs::write(&stranger, [0u8; 64]).expect("a file can be written");
    mon3tr(&["render", package, "--motion", text(&stranger)]).fails_naming(&["song.mp3", "bvh"]);
    mon3tr(&["render", package, "--size", "0x9"]).fails_naming(&["0x9", "1024x1024"]);
    mon3tr(&["render", package, "--view", "moon"]).fails_naming(&["moon", "three-quarter"]);
    mon3tr(&["render", package, "--frames", "9..3"]).fails_naming(&["9..3"]);
    mon3tr(&["render", package, "--frames", "90000.."]).fails_naming(&["90000"]);
}

#[test]
fn a_missing_vulkan_driver_is_explained() {
    if runtime().is_none() {
        return;
    }
    let (_folder, package) = folder_with_package();
    let outcome = Outcome::of(
        support::command(&["render", text(&package)])
            .env("VK_DRIVER_FILES", "/nonexistent/icd.json")
            .env("VK_ICD_FILENAMES", "/nonexistent/icd.json")
            .env("VK_ADD_DRIVER_FILES", ""),
    );
    outcome.fails_naming(&["Vulkan", "install"]);
}

#[test]
fn an_unknown_device_name_lists_those_there_are() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    let (_folder, package) = folder_with_package();
    mon3tr(&["render", text(&package), "--gpu", "Voodoo 2"])
        .fails_naming(&["Voodoo 2", "this machine has"]);
}

#[test]
fn a_missing_onnx_runtime_is_explained() {
    let (folder, package) = folder_with_package();
    let outcome = Outcome::of(
        support::command(&["render", text(&package)])
            .env("ORT_DYLIB_PATH", "/nonexistent/libonnxruntime.so"),
    );
    outcome.fails_naming(&["/nonexistent/libonnxruntime.so", "./run"]);
    let stranger = folder.path().join("libonnxruntime.so");
    std::fs::write(&stranger, "no library").expect("a file can be written");
    mon3tr(&["render", text(&package), "--ort", text(&stranger)])
        .fails_naming(&["libonnxruntime.so", "1.24"]);
}

#[test]
fn the_demo_looks_for_its_mistakes_before_it_bakes() {
    if gpu().is_none() || runtime().is_none() {
        return;
    }
    // An empty cache: a demo that began to bake would leave something in it.
    let cache = tempfile::tempdir().expect("a temporary folder");
    let demo = |arguments: &[&str], unset: &[&str], set: &[(&str, &str)]| {
        let mut command = support::command(&[&["demo"], arguments].concat());
        command
            .current_dir(cache.path())
            .env("MON3TR_CACHE", cache.path());
        for name in unset {
            command.env_remove(name);
        }
        command.envs(set.iter().copied());
        Outcome::of(&mut command)
    };
    demo(&["--motion", "missing.bvh"], &[], &[]).fails_naming(&["missing.bvh"]);
    demo(&["--gpu", "Voodoo 2"], &[], &[]).fails_naming(&["Voodoo 2", "this machine has"]);
    let nowhere = "/nonexistent/libonnxruntime.so";
    demo(&[], &[], &[("ORT_DYLIB_PATH", nowhere)]).fails_naming(&[nowhere, "./run"]);
    demo(
        &["--display", "window"],
        &["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"],
        &[],
    )
    .fails_naming(&["--display window", "needs a display"]);
    demo(&[], &[], &[("MON3TR_MAKEHUMAN", "/nonexistent")])
        .fails_naming(&["/nonexistent", "./run"]);
    assert!(
        !cache.path().join("avatars").exists(),
        "the demo baked before it looked"
    );
}

#[test]
fn bake_without_its_raw_material_says_where_it_comes_from() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let outcome = Outcome::of(
        support::command(&["bake", "--out", text(&folder.path().join("x.m3a"))])
            .env("MON3TR_MAKEHUMAN", folder.path().join("nothing")),
    );
    outcome.fails_naming(&["MakeHuman", "./run"]);
    mon3tr(&["bake", "--gaussians", "7"]).fails_naming(&["7", "20"]);
}

#[test]
fn insecure_servers_are_refused_unless_they_are_wanted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let data = text(folder.path());
    let listen = ["serve", "--listen", "0.0.0.0:0", "--data", data];
    mon3tr(&listen).fails_naming(&["0.0.0.0", "without TLS", "--insecure"]);
    // Of the addresses that documents use: nobody is there.
    let link = "http://203.0.113.9:9/rooms/r#token";
    let receive = ["receive", link, "--display", "none", "--seconds", "1"];
    mon3tr(&receive).fails_naming(&["http://203.0.113.9:9", "without TLS", "--insecure"]);
}

#[test]
fn tokens_are_made_and_taken_back_only_where_a_server_has_started() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let elsewhere = folder.path().join("elsewhere");
    let data = text(&elsewhere);
    let name = "0".repeat(32);
    for asked in [["--new-owner", "ada"], ["--revoke", &name]] {
        let refused = mon3tr(&[&["serve", "--data", data][..], &asked].concat());
        refused.fails_naming(&[data, "there is no", "--data"]);
        assert!(!elsewhere.exists(), "nothing is made there");
    }
}
