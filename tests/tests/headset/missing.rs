//! Missing parts of a machine: each has its message with what to do.

use std::process::Command;

use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

use crate::program::Program;

/// The error of a program that cannot begin, and whether waiting may help.
fn refusal(monado: &Monado, change: impl FnOnce(&mut Command)) -> (String, bool) {
    let program = Program::start_with(monado, 10, &["--figure=none"], change);
    let ended = program.ended();
    assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);
    let last = ended.last();
    assert_eq!(last["event"], "failed", "{last}");
    assert_eq!(last["is_loss"], false, "nothing was there to lose: {last}");
    let text = last["error"].as_str().expect("a text").to_owned();
    println!("{text}");
    assert!(!text.contains('\n'), "one line: {text}");
    (text, last["may_pass"] == true)
}

#[test]
fn a_missing_loader_is_named_with_the_package_it_comes_in() {
    attended(|| {
        let Some(monado) = Monado::place(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let program = Program::start_with(&monado, 10, &["--figure=none"], |command| {
            command.env("MON3TR_MONADO", "/nonexistent");
        });
        let ended = program.ended();
        let text = ended.last()["error"]
            .as_str()
            .unwrap_or_default()
            .to_owned();
        if !text.contains("loader") {
            println!("skipped: this machine has a loader of its own: {text}");
            return;
        }
        assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);
        for part in [
            "libopenxr_loader.so.1",
            "./run",
            "apt install libopenxr-loader1",
        ] {
            assert!(text.contains(part), "{part} in: {text}");
        }
        assert_eq!(ended.last()["may_pass"], false, "waiting does not help");
    });
}

#[test]
fn a_manifest_that_is_not_there_is_no_runtime() {
    attended(|| {
        let Some(monado) = Monado::place(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let nowhere = monado.runtime_directory().join("no-runtime.json");
        let (text, may_pass) = refusal(&monado, |command| {
            command.env("XR_RUNTIME_JSON", nowhere);
        });
        for part in ["no OpenXR runtime is active", "XR_RUNTIME_JSON"] {
            assert!(text.contains(part), "{part} in: {text}");
        }
        assert!(!may_pass, "waiting does not help: {text}");
    });
}

#[test]
fn a_stopped_service_is_distinguished_from_a_missing_runtime() {
    attended(|| {
        let Some(mut monado) = Monado::place(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let (text, may_pass) = refusal(&monado, |_| {});
        for part in ["its service is not running", "monado-service"] {
            assert!(text.contains(part), "{part} in: {text}");
        }
        assert!(may_pass, "it may be started: {text}");
        // The socket that a killed service left is no service either.
        monado.restart();
        monado.kill();
        let (again, _) = refusal(&monado, |_| {});
        assert!(again.contains("its service is not running"), "{again}");
    });
}

#[test]
fn a_headset_without_a_vulkan_device_is_reported() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        // Vulkan's loader leaves all drivers out; the folder stays named, because libraries lie there.
        let (text, _) = refusal(&monado, |command| {
            command.env("VK_LOADER_DRIVERS_DISABLE", "*");
        });
        assert!(text.contains("Vulkan"), "{text}");
        assert!(monado.is_running(), "the service:\n{}", monado.log());
    });
}
