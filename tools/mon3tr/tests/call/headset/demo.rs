//! `mon3tr demo --display xr` where no runtime is active: it brings a Monado of its own, and leaves nothing of it.

use super::viewer::can_draw;
use crate::command::{Outcome, command, json, text};
use crate::house::{count, wait_for};
use reconstruct::bake::BAKE_VERSION;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use synthetic_person::Puppet;
use tempfile::TempDir;

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

/// Processes that have `mark` in their environment: their numbers and command lines.
fn processes_with(mark: &str) -> Vec<(i32, String)> {
    let all = std::fs::read_dir("/proc").expect("Linux");
    let all = all.filter_map(|entry| Some(entry.ok()?.path()));
    let ours = all.filter(|process| {
        // Others' cannot be read, and some end meanwhile.
        let environment = std::fs::read(process.join("environ")).unwrap_or_default();
        String::from_utf8_lossy(&environment).contains(mark)
    });
    let command = |process: PathBuf| {
        let line = std::fs::read(process.join("cmdline")).ok()?;
        let number = process.file_name()?.to_str()?.parse().ok()?;
        // One that has ended and is not waited for yet has neither line nor environment.
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        (!line.is_empty()).then_some((number, line))
    };
    ours.filter_map(command).collect()
}

/// A folder as a demo's cache, with a puppet where the demo person would lie, for the bake has a test of its own; and a place in it
/// for all that is temporary, by which the demo's processes are known.
struct Place {
    folder: TempDir,
    temporary: PathBuf,
}

impl Place {
    fn make() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = |name: &str| folder.path().join(name);
        for made in ["avatars", "tmp", "config"] {
            std::fs::create_dir(file(made)).expect("a folder");
        }
        let avatar = file(&format!("avatars/demo-20000-v{BAKE_VERSION}.m3a"));
        Puppet::small().avatar().save(&avatar).expect("a puppet");
        let temporary = file("tmp");
        Self { folder, temporary }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `demo --display xr` for so many frames.
    fn demo(&self, frames: u32) -> Command {
        let (out, figures) = (self.file("pictures"), self.file("figures.json"));
        let mut demo = command(&["demo", "--display", "xr", "--gaussians", "20k"]);
        demo.args(["--frames", &frames.to_string(), "--size", "480x360"])
            .args(["--out", text(&out), "--json", text(&figures)])
            .env("MON3TR_CACHE", self.folder.path())
            .env("TMPDIR", &self.temporary)
            .env("XDG_CONFIG_HOME", self.file("config"))
            .env_remove("XR_RUNTIME_JSON")
            .env_remove("XDG_RUNTIME_DIR");
        demo
    }

    /// Waits until there is no process of the demo's, and demands that nothing temporary of it is left.
    fn assert_left_clean(&self) {
        let mark = format!("TMPDIR={}", text(&self.temporary));
        wait_for("the end of all processes", || {
            let left = processes_with(&mark);
            left.is_empty().then_some(())
        });
        let left = std::fs::read_dir(&self.temporary).expect("the folder");
        let left: Vec<_> = left.flatten().map(|entry| entry.file_name()).collect();
        // ONNX Runtime leaves a file of its own for its next session.
        let left: Vec<_> = left.iter().filter(|name| *name != ".ses").collect();
        assert!(left.is_empty(), "left behind: {left:?}");
    }
}

/// A demo that runs. It is killed where a test forgets it.
struct Demo(Child);

impl Demo {
    fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("it can be started"))
    }

    fn has_ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().expect("a child can be asked")
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // It has ended as a rule. Asked to end, it takes its own processes along.
        if self.has_ended().is_none() {
            let _ = kill_process(Pid::from_child(&self.0), Signal::TERM);
            let _ = self.0.wait();
        }
    }
}

/// Waits until the receiver says that it fetches the avatar: once everybody is there, Monado, the server and the sender.
fn wait_for_receiver(demo: &mut Demo, said: &Path) {
    wait_for("the receiver", || {
        let ended = demo.has_ended();
        let said = std::fs::read_to_string(said).expect("what it says");
        assert!(ended.is_none(), "it ended before: {ended:?}\n{said}");
        said.contains("fetching the avatar").then_some(())
    });
}

#[test]
fn a_demo_that_is_asked_to_end_takes_its_processes_and_folders_along() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let mut demo = place.demo(100_000);
    let said = place.file("said");
    demo.stdout(Stdio::null())
        .stderr(File::create(&said).expect("a file"));
    let mut demo = Demo::start(&mut demo);
    wait_for_receiver(&mut demo, &said);
    let mark = format!("TMPDIR={}", text(&place.temporary));
    assert!(processes_with(&mark).len() >= 5, "and itself");
    kill_process(Pid::from_child(&demo.0), Signal::TERM).expect("it is there");
    let status = wait_for("its end", || demo.has_ended());
    assert!(!status.success(), "it was not shown to the end: {status}");
    place.assert_left_clean();
}

#[test]
fn a_demo_that_is_killed_takes_its_processes_along() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let mut demo = place.demo(100_000);
    demo.stdout(Stdio::null()).stderr(Stdio::null());
    let mut demo = Demo::start(&mut demo);
    let mark = format!("TMPDIR={}", text(&place.temporary));
    wait_for("five processes", || {
        (processes_with(&mark).len() >= 5).then_some(())
    });
    demo.0.kill().expect("it is there");
    wait_for("its end", || demo.has_ended());
    wait_for("the end of all processes", || {
        processes_with(&mark).is_empty().then_some(())
    });
}

#[test]
fn a_demo_whose_monado_dies_says_so_at_once_and_ends() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let (mut demo, said) = (place.demo(100_000), place.file("said"));
    demo.stdout(Stdio::null())
        .stderr(File::create(&said).expect("a file"));
    let mut demo = Demo::start(&mut demo);
    wait_for_receiver(&mut demo, &said);
    let mark = format!("TMPDIR={}", text(&place.temporary));
    let monado = processes_with(&mark);
    let mut monado = monado.iter();
    let monado = monado.find(|(_, line)| line.contains("monado-service"));
    let (number, _) = monado.expect("Monado is there");
    let number = Pid::from_raw(*number).expect("a process");
    kill_process(number, Signal::SEGV).expect("it can be killed");
    let status = wait_for("its end", || demo.has_ended());
    assert!(!status.success(), "it was not shown to the end: {status}");
    let said = std::fs::read_to_string(&said).expect("what it says");
    let error = said.lines().find(|line| line.starts_with("error: "));
    for part in ["Monado has ended by itself", "signal: 11"] {
        let told = error.is_some_and(|line| line.contains(part));
        assert!(told, "{part} in:\n{said}");
    }
    place.assert_left_clean();
}

#[test]
fn the_demo_in_a_headset_leaves_both_eyes_pictures_and_the_sessions_figures_and_no_process() {
    if can_draw().is_none() || !monado_alone() {
        return;
    }
    let place = Place::make();
    let shown = Outcome::of(&mut place.demo(60)).succeeds();

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
