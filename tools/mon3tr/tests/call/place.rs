//! Where a test's demo lives, and what becomes of its processes.

use crate::command::{command, text};
use crate::house::wait_for;
use reconstruct::bake::BAKE_VERSION;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use synthetic_person::Puppet;
use tempfile::TempDir;

/// Nothing, after a line that says why, where the networks cannot be run or nothing can be drawn.
pub(crate) fn can_draw() -> Option<()> {
    test_support::onnx::runtime()?;
    test_support::vulkan::gpu().map(drop)
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
pub(crate) struct Place {
    folder: TempDir,
    temporary: PathBuf,
}

impl Place {
    pub(crate) fn make() -> Self {
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

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `demo` with these arguments.
    pub(crate) fn demo(&self, arguments: &[&str]) -> Command {
        let (out, figures) = (self.file("pictures"), self.file("figures.json"));
        let mut demo = command(&["demo", "--gaussians", "20k", "--size", "480x360"]);
        demo.args(["--out", text(&out), "--json", text(&figures)])
            .args(arguments)
            .env("MON3TR_CACHE", self.folder.path())
            .env("TMPDIR", &self.temporary)
            .env("XDG_CONFIG_HOME", self.file("config"))
            .env_remove("XR_RUNTIME_JSON")
            .env_remove("XDG_RUNTIME_DIR");
        demo
    }

    /// The numbers and command lines of the demo's processes.
    pub(crate) fn processes(&self) -> Vec<(i32, String)> {
        processes_with(&format!("TMPDIR={}", text(&self.temporary)))
    }

    /// Waits until there is no process of the demo's, and demands that nothing temporary of it is left.
    pub(crate) fn assert_left_clean(&self) {
        wait_for("the end of all processes", || {
            self.processes().is_empty().then_some(())
        });
        let left = std::fs::read_dir(&self.temporary).expect("the folder");
        let left: Vec<_> = left.flatten().map(|entry| entry.file_name()).collect();
        // ONNX Runtime leaves a file of its own for its next session.
        let left: Vec<_> = left.iter().filter(|name| *name != ".ses").collect();
        assert!(left.is_empty(), "left behind: {left:?}");
    }
}

/// A demo that runs. It is killed where a test forgets it.
pub(crate) struct Demo(Child);

impl Demo {
    pub(crate) fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("it can be started"))
    }

    pub(crate) fn has_ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().expect("a child can be asked")
    }

    /// Asks it to end, as a service manager does.
    pub(crate) fn ask_to_end(&self) {
        kill_process(Pid::from_child(&self.0), Signal::TERM).expect("it is there");
    }

    /// Ctrl-C in its terminal; it has to be the first process of a group.
    pub(crate) fn press_ctrl_c(&self) {
        kill_process_group(Pid::from_child(&self.0), Signal::INT).expect("it is there");
    }

    /// As `kill -9`.
    pub(crate) fn kill(&mut self) {
        self.0.kill().expect("it is there");
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
pub(crate) fn wait_for_receiver(demo: &mut Demo, said: &Path) {
    wait_until_it_says("fetching the avatar", demo, said);
}

/// Waits until one of a demo's processes has said `words`.
pub(crate) fn wait_until_it_says(words: &str, demo: &mut Demo, said: &Path) {
    wait_for(words, || {
        let ended = demo.has_ended();
        let said = std::fs::read_to_string(said).expect("what it says");
        assert!(ended.is_none(), "it ended before: {ended:?}\n{said}");
        said.contains(words).then_some(())
    });
}

/// Kills the demo's process whose command line has these words: it can say nothing.
pub(crate) fn kill(place: &Place, words: &str) {
    let processes = place.processes();
    let one = processes.iter().find(|(_, line)| line.contains(words));
    let (number, _) = one.unwrap_or_else(|| panic!("no `{words}` in {processes:?}"));
    let number = Pid::from_raw(*number).expect("a process");
    kill_process(number, Signal::KILL).expect("it can be killed");
}

/// Waits for a demo's end, which is to be a failure whose one error has all of these words; returns all that it said.
pub(crate) fn fails_naming(demo: &mut Demo, said: &Path, words: &[&str]) -> String {
    let status = wait_for("its end", || demo.has_ended());
    let said = std::fs::read_to_string(said).expect("what it says");
    assert_eq!(status.code(), Some(1), "{said}");
    let errors: Vec<_> = (said.lines())
        .filter(|line| line.starts_with("error: "))
        .collect();
    assert_eq!(errors.len(), 1, "one line says it:\n{said}");
    for word in words {
        assert!(errors[0].contains(word), "`{word}` is missing in:\n{said}");
    }
    said
}
