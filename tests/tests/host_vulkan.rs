//! The machine's own Vulkan beside the set that `./run` pins: layers, drivers, settings. None of it reaches a program that runs on
//! the pinned set, ours or Monado's service; all of it does where the machine's own Vulkan is used.
//!
//! Wherever Vulkan's loader looks, a library lies that writes its name down as soon as it is loaded.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;

use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use tempfile::TempDir;
use test_support::monado::{Compositor, Driver, Monado};
use test_support::program::through_runner;
use test_support::service::{self, attended};
use test_support::vulkan::or_skip;

/// The program among this file's tests that opens a device.
const OPENS: &str = "opens_a_device";

/// The variable with the file that a library writes to.
const SAID: &str = "MON3TR_TEST_TRAPS";

/// It says that it was loaded, and by what name.
const TRAP: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
__attribute__((constructor)) static void loaded(void) {
    Dl_info info;
    const char *to = getenv("MON3TR_TEST_TRAPS");
    if (!to || !dladdr((void *)loaded, &info)) return;
    int file = open(to, O_WRONLY | O_CREAT | O_APPEND, 0600);
    const char *name = strrchr(info.dli_fname, '/');
    if (file < 0 || !name) return;
    if (write(file, name + 1, strlen(name + 1)) < 0 || write(file, "\n", 1) < 0) _exit(99);
    close(file);
}
"#;

/// A machine's Vulkan in a folder: a user's home, the system's folders, and those that variables add.
struct Machine {
    folder: TempDir,
}

impl Machine {
    fn furnish() -> Self {
        let machine = Self {
            folder: tempfile::tempdir().expect("a folder"),
        };
        let source = machine.path("trap.c");
        std::fs::write(&source, TRAP).expect("a file");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-o"]);
        compiler
            .args([&machine.path("trap.so"), &source])
            .arg("-ldl");
        let built = compiler.status().expect("cc, which Rust links with");
        assert!(built.success(), "cc: {built}");
        for home in [
            "home/.local/share",
            "home/.config",
            "data",
            "config",
            "data-home",
        ] {
            machine.put_layer(&format!("{home}/vulkan/implicit_layer.d"), "implicit");
            machine.put_layer(&format!("{home}/vulkan/explicit_layer.d"), "explicit");
            machine.put_driver(&format!("{home}/vulkan/icd.d"));
        }
        machine.put_layer("added-implicit", "implicit");
        machine.put_layer("added-explicit", "explicit");
        machine.put_driver("added-driver");
        let forced = machine.put_layer("configurator", "forced");
        let settings = serde_json::json!({
            "file_format_version": "1.0.0",
            "settings": { "layers": [
                { "name": "VK_LAYER_MON3TR_forced", "path": forced, "control": "on" },
                { "control": "unordered_layer_location" },
            ] },
        });
        for home in ["home/.local/share", "data-home"] {
            let folder = machine.path(home).join("vulkan/loader_settings.d");
            std::fs::create_dir_all(&folder).expect("a folder");
            let file = folder.join("vk_loader_settings.json");
            std::fs::write(file, settings.to_string()).expect("a file");
        }
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A copy of the library, named for what leads to it.
    fn library(&self, of: &str) -> PathBuf {
        let library = self.path(&format!("{}.so", of.replace(['/', '.'], "_")));
        std::fs::copy(self.path("trap.so"), &library).expect("a library");
        library
    }

    fn put(&self, folder: &str, manifest: &serde_json::Value) -> PathBuf {
        let folder = self.path(folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        let file = folder.join("trap.json");
        std::fs::write(&file, manifest.to_string()).expect("a manifest");
        file
    }

    fn put_layer(&self, folder: &str, kind: &str) -> PathBuf {
        let mut layer = serde_json::json!({
            "name": format!("VK_LAYER_MON3TR_{kind}"),
            "type": "GLOBAL",
            "library_path": self.library(folder),
            "api_version": "1.3.0",
            "implementation_version": "1",
            "description": "a trap",
        });
        if kind == "implicit" {
            layer["disable_environment"] = serde_json::json!({ "MON3TR_TEST_NO_TRAPS": "1" });
            // One name each: of two layers with one name the loader takes the first.
            layer["name"] = format!("VK_LAYER_MON3TR_{}", folder.replace(['/', '.'], "_")).into();
        }
        let manifest = serde_json::json!({ "file_format_version": "1.0.0", "layer": layer });
        self.put(folder, &manifest)
    }

    fn put_driver(&self, folder: &str) {
        let icd =
            serde_json::json!({ "library_path": self.library(folder), "api_version": "1.3.0" });
        let manifest = serde_json::json!({ "file_format_version": "1.0.0", "ICD": icd });
        self.put(folder, &manifest);
    }

    /// The variables for a program; its libraries write to the file of that name.
    fn environment(&self, said: &str) -> Vec<(OsString, OsString)> {
        let folders = [
            (SAID, said),
            ("HOME", "home"),
            ("XDG_DATA_HOME", "data-home"),
            ("XDG_CONFIG_HOME", "home/.config"),
            ("VK_ADD_IMPLICIT_LAYER_PATH", "added-implicit"),
            ("VK_ADD_LAYER_PATH", "added-explicit"),
            ("VK_ADD_DRIVER_FILES", "added-driver/trap.json"),
        ];
        let paths = folders.map(|(name, path)| (name.into(), self.path(path).into()));
        // Beside those where the machine's own driver is.
        let systems = [
            ("XDG_DATA_DIRS", "data", "/usr/local/share:/usr/share"),
            ("XDG_CONFIG_DIRS", "config", "/etc/xdg"),
        ];
        let systems = systems.map(|(name, path, usual)| {
            let path = self.path(path);
            (name.into(), format!("{}:{usual}", path.display()).into())
        });
        let forced = (
            "VK_INSTANCE_LAYERS".into(),
            "VK_LAYER_MON3TR_explicit".into(),
        );
        let paths = paths.into_iter().chain(systems);
        paths.chain([forced]).collect()
    }

    /// The libraries that a program with this output name loaded.
    fn loaded(&self, said: &str) -> BTreeSet<String> {
        let text = std::fs::read_to_string(self.path(said)).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }
}

/// Whether there is a device; validation is not needed here.
fn has_device() -> bool {
    let opened = Gpu::open(&GpuChoice::default(), false);
    or_skip(opened.map_err(|why| why.to_string())).is_some()
}

/// Whether Vulkan comes from a prefix of `./run`'s.
fn is_pinned() -> bool {
    let driver = std::env::var("VK_DRIVER_FILES").unwrap_or_default();
    driver.ends_with("/lavapipe/root/usr/share/vulkan/icd.d/lvp_icd.json")
}

/// Asserts which of a machine's libraries a program loaded.
fn assert_met(machine: &Machine, said: &str) {
    let loaded = machine.loaded(said);
    println!("{said}: {loaded:?}");
    if is_pinned() {
        assert!(loaded.is_empty(), "{said} meets the machine's: {loaded:?}");
    } else {
        let layer = "data_vulkan_implicit_layer_d.so";
        assert!(loaded.contains(layer), "{said} misses layers: {loaded:?}");
    }
}

/// This file's program that opens a device, with a machine's Vulkan around it.
fn open_device<'a>(
    environment: impl IntoIterator<Item = (&'a OsStr, &'a OsStr)>,
) -> std::process::Output {
    let this = std::env::args_os().next().expect("a program's name");
    let mut command = through_runner(this);
    command
        .args([OPENS, "--exact", "--ignored", "--nocapture"])
        .envs(environment);
    service::output("a program with a device", &mut command)
}

fn borrowed(pairs: &[(OsString, OsString)]) -> impl Iterator<Item = (&OsStr, &OsStr)> {
    pairs
        .iter()
        .map(|(name, value)| (name.as_os_str(), value.as_os_str()))
}

#[test]
fn a_program_meets_the_machines_vulkan_only_where_that_is_the_one_used() {
    if !has_device() {
        return;
    }
    let machine = Machine::furnish();
    let output = open_device(borrowed(&machine.environment("ours")));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    // The pinned set's own layer is there all the same.
    assert!(said.contains("validated: true") || !is_pinned(), "{said}");
    assert_met(&machine, "ours");

    // The traps work: with their variables set the same program loads them. Older loaders ignore these variables.
    if !is_pinned() {
        return;
    }
    let mut led = machine.environment("led");
    let layers = machine.path("added-implicit");
    led.push(("VK_IMPLICIT_LAYER_PATH".into(), layers.into()));
    open_device(borrowed(&led));
    let loaded = machine.loaded("led");
    assert!(loaded.contains("added-implicit.so"), "no trap: {loaded:?}");
}

/// Not a test: the program that the tests above start.
#[test]
#[ignore = "it is a program: the tests here start it"]
fn opens_a_device() {
    if std::env::var_os(SAID).is_none() {
        println!("skipped: no test has started it");
        return;
    }
    let choice: GpuChoice = std::env::var("MON3TR_GPU")
        .unwrap_or_default()
        .parse()
        .expect("any text is a choice");
    let (opened, validated) = match Gpu::open(&choice, true) {
        Err(VulkanError::NoValidationLayer) => (Gpu::open(&choice, false), false),
        opened => (opened, true),
    };
    let device = opened.expect("a device");
    println!("{}, validated: {validated}", device.info().name);
}

#[test]
fn so_do_monados_service_and_its_client() {
    if !has_device() {
        return;
    }
    attended(|| {
        let machine = Machine::furnish();
        for (compositor, name) in [(Compositor::Null, "null"), (Compositor::Window, "window")] {
            let told = machine.environment(&format!("{name}-service"));
            let Some(monado) = Monado::start_with(Driver::Simulated, compositor, told) else {
                return;
            };
            let client = format!("{name}-client");
            let mut command = monado.client(env!("CARGO_BIN_EXE_headset-frames"));
            command
                .args(["3", "--figure=none"])
                .envs(machine.environment(&client));
            let output = service::output("headset-frames", &mut command);
            service::assert_all_live();
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{errors}\n{}", monado.log());
            assert_met(&machine, &client);
            assert_met(&machine, &format!("{name}-service"));
        }
    });
}

#[test]
fn variables_of_the_pinned_set_are_cleared_before_the_machines_vulkan_is_probed() {
    let repo = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let cache = tempfile::tempdir().expect("a folder");
    let script = r#"
        . "$repo/scripts/prepare.sh"
        while IFS= read -r one; do export "$one"; done < <(lavapipe_environment "$MON3TR_CACHE/lavapipe/root")
        env | grep -c ^VK_
        export VK_LAYER_PATH=/layers/of/my/own
        choose_vulkan auto
        env | grep ^VK_
    "#;
    let output = Command::new("bash")
        .args(["-euc", script])
        .env_clear()
        .envs(["PATH", "HOME"].map(|name| (name, std::env::var_os(name).unwrap_or_default())))
        .env("repo", repo)
        .env("MON3TR_CACHE", cache.path())
        .output()
        .expect("bash");
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines, ["5", "VK_LAYER_PATH=/layers/of/my/own"], "{errors}");
}
