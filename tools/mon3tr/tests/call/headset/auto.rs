//! `--display auto` and `--display xr` where there is no headset: one line that says why, and the next best place, or none.

use crate::house::{House, Program, count};
use crate::place::can_draw;
use serde_json::Value;
use std::process::Command;
use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

/// Where what is said is explained.
const DOCUMENTED: &str = include_str!("../../../../../docs/headset.md");

/// A way in which there is no headset.
struct Lack<'a> {
    /// What is said, as the documentation has it.
    said: &'static str,
    /// What to do about it.
    advice: &'static str,
    /// Whether a runtime's library is there, which says more, in lines of its own.
    runtime: bool,
    /// Sees to it.
    lacking: &'a dyn Fn(&mut Command),
}

/// `receive LINK --display DISPLAY` with something lacking.
fn receive(
    house: &House,
    monado: &Monado,
    lack: &Lack<'_>,
    display: &str,
    arguments: &[&str],
) -> Program {
    let mut command = monado.client(env!("CARGO_BIN_EXE_mon3tr"));
    command
        .args(["receive", "--display", display])
        .args(["--json", &house.new_report()])
        .args(arguments)
        .env("RUST_LOG", "warn")
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY");
    (lack.lacking)(&mut command);
    Program::start_as(house, house.path("viewer").as_ref(), &mut command)
}

/// What follows `words` on the one line that has them.
fn after<'a>(said: &'a str, words: &str) -> &'a str {
    let mut lines = said.lines().filter_map(|line| line.split_once(words));
    let (_, rest) = lines
        .next()
        .unwrap_or_else(|| panic!("no `{words}` in:\n{said}"));
    assert!(lines.next().is_none(), "`{words}` once:\n{said}");
    rest
}

/// What `--display xr` says instead of showing anything, after checking it.
fn refusal(house: &House, monado: &Monado, lack: &Lack<'_>, link: &str) -> String {
    let said = receive(house, monado, lack, "xr", &[link]).fails();
    println!("{said}");
    let lines = said.lines().filter(|line| !line.is_empty()).count();
    assert!(lines == 1 || lack.runtime, "one line:\n{said}");
    let why = after(&said, "error: ").to_owned();
    for words in [lack.said, lack.advice] {
        assert!(why.contains(words), "`{words}` in: {why}");
    }
    assert!(DOCUMENTED.contains(lack.said), "{} is explained", lack.said);
    why
}

#[test]
fn without_a_headset_auto_says_why_in_one_line_and_leaves_pictures_where_xr_fails_with_that_line() {
    attended(|| {
        if can_draw().is_none() {
            return;
        }
        let Some(monado) = Monado::place(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let nowhere = monado.runtime_directory().join("nowhere");
        let no_loader = |command: &mut Command| {
            command.env("MON3TR_MONADO", &nowhere);
        };
        let no_manifest = |command: &mut Command| {
            command.env("XR_RUNTIME_JSON", &nowhere);
        };
        let lacks = [
            Lack {
                said: "no OpenXR loader",
                advice: "apt install libopenxr-loader1",
                runtime: false,
                lacking: &no_loader,
            },
            Lack {
                said: "no OpenXR runtime is active",
                advice: "XR_RUNTIME_JSON",
                runtime: false,
                lacking: &no_manifest,
            },
            Lack {
                said: "the OpenXR runtime does not answer",
                advice: "monado-service",
                runtime: true,
                lacking: &|_| {},
            },
        ];
        let house = House::open();
        let sender = house.sender(&[]);
        let link = sender.viewers.as_str();
        for (number, lack) in lacks.iter().enumerate() {
            // A loader of the machine's own stands in for the one that is taken away.
            if number == 0 && has_loader() {
                println!("skipped: this machine has an OpenXR loader of its own");
                continue;
            }
            let why = refusal(&house, &monado, lack, link);
            let out = house.path(&format!("auto-{number}"));
            let arguments = [link, "--seconds", "1", "--size", "160x120", "--out", &out];
            let auto = receive(&house, &monado, lack, "auto", &arguments);
            let (report, said) = auto.report_and_said();
            println!("{said}");
            assert_eq!(after(&said, "no headset: "), why, "the same reason");
            assert!(!after(&said, "no window: ").is_empty(), "nor a window");
            let picture = image::open(format!("{out}/last.png")).expect("a picture");
            assert_eq!((picture.width(), picture.height()), (160, 120), "its size");
            assert!(report["headset"].is_null(), "{report:#}");
            assert!(count(&report["call"], "released") > 0, "{report:#}");
        }
    });
}

#[test]
fn without_a_vulkan_device_for_the_headset_auto_and_xr_both_say_so() {
    attended(|| {
        if can_draw().is_none() {
            return;
        }
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        // Vulkan's loader leaves all drivers out; where they are is still told, for libraries lie beside them.
        let lack = Lack {
            said: "cannot draw for the headset: no Vulkan device found",
            advice: "mesa-vulkan-drivers",
            runtime: true,
            lacking: &|command| {
                command.env("VK_LOADER_DRIVERS_DISABLE", "*");
            },
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let link = sender.viewers.as_str();
        let why = refusal(&house, &monado, &lack, link);
        let said = receive(&house, &monado, &lack, "auto", &[link]).fails();
        assert_eq!(after(&said, "no headset: "), why, "the same reason");
        // Nothing else can be drawn either, which is another line.
        let error = after(&said, "error: ");
        assert!(error.contains("Vulkan"), "{error}");
        assert!(monado.is_running(), "the service:\n{}", monado.log());
    });
}

#[test]
fn without_a_headset_auto_shows_a_window_where_there_is_a_display() {
    attended(|| {
        if can_draw().is_none() {
            return;
        }
        let Some(monado) = Monado::place(Driver::Simulated, Compositor::Window) else {
            return;
        };
        let display = monado.display().expect("an X server");
        let lack = Lack {
            said: "the OpenXR runtime does not answer",
            advice: "monado-service",
            runtime: true,
            lacking: &|command| {
                command.env("DISPLAY", &display);
            },
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let arguments = [
            sender.viewers.as_str(),
            "--seconds",
            "2",
            "--size",
            "160x120",
        ];
        let auto = receive(&house, &monado, &lack, "auto", &arguments);
        let (report, said) = auto.report_and_said();
        assert!(after(&said, "no headset: ").contains(lack.said), "{said}");
        assert!(!said.contains("no window"), "a window:\n{said}");
        assert_eq!(report["pictures"], Value::Array(Vec::new()), "none on disk");
        let shown = &report["drawing"]["measured"]["pictures"];
        assert!(count(shown, "shown") > 0, "it was shown: {shown:#}");
    });
}

/// Whether this machine's own libraries have an `OpenXR` loader.
fn has_loader() -> bool {
    let folders = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/lib"];
    let triplet = format!("/usr/lib/{}-linux-gnu", std::env::consts::ARCH);
    (folders.iter().copied().chain([triplet.as_str()])).any(|folder| {
        std::path::Path::new(folder)
            .join("libopenxr_loader.so.1")
            .exists()
    })
}
