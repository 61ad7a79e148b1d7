//! The program under test: lines of JSON out, lines of commands in.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use image::RgbaImage;
use serde_json::Value;
use tempfile::TempDir;
use test_support::headset_reference::numbers;
use test_support::monado::{Head, Monado, Scripted};
use test_support::service::{LONGEST_WAIT, assert_all_live};

/// How often the services are checked.
const LOOK: Duration = Duration::from_millis(50);

/// A program that runs. It is killed where a test forgets it.
pub(crate) struct Program {
    child: Child,
    commands: Option<ChildStdin>,
    lines: Receiver<Value>,
    seen: Vec<Value>,
    errors: Arc<Mutex<String>>,
    pictures: TempDir,
}

/// How it ended.
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    pub(crate) lines: Vec<Value>,
    /// Its other output.
    pub(crate) errors: String,
}

impl Program {
    /// Starts `headset-frames FRAMES ARGUMENTS..` so that it finds the service.
    pub(crate) fn start(monado: &Monado, frames: u64, arguments: &[&str]) -> Self {
        Self::start_with(monado, frames, arguments, |_| {})
    }

    /// Starts it steered in an empty studio, with one back end and pictures of `size` pixels, and waits until frames come.
    pub(crate) fn in_studio(monado: &Monado, back_end: &str, size: [u32; 2]) -> Self {
        let eye = format!("--eye={}x{}", size[0], size[1]);
        let back_end = format!("--back-end={back_end}");
        let arguments = [
            "--steered",
            "--figure=none",
            "--surround=studio",
            &back_end,
            &eye,
        ];
        let mut program = Self::start(monado, u64::MAX, &arguments);
        program.wait_for_frames(5);
        program
    }

    /// [`Self::start`], with the command changed before it is run.
    pub(crate) fn start_with(
        monado: &Monado,
        frames: u64,
        arguments: &[&str],
        change: impl FnOnce(&mut Command),
    ) -> Self {
        let pictures = tempfile::tempdir().expect("a folder");
        let mut command = monado.client(env!("CARGO_BIN_EXE_headset-frames"));
        command
            .arg(frames.to_string())
            .args(arguments)
            .env("RUST_LOG", "warn")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        if arguments.contains(&"--steered") {
            let folder = pictures.path().display();
            command.arg(format!("--read-to={folder}"));
        }
        change(&mut command);
        let mut child = command.spawn().expect("the program");
        let (out, mut error) = (child.stdout.take(), child.stderr.take());
        let (give, lines) = channel();
        thread::spawn(move || {
            for line in BufReader::new(out.expect("a pipe")).lines() {
                let Ok(line) = line else { return };
                let line = serde_json::from_str(&line).unwrap_or(Value::String(line));
                if give.send(line).is_err() {
                    return;
                }
            }
        });
        let errors = Arc::new(Mutex::new(String::new()));
        let into = Arc::clone(&errors);
        thread::spawn(move || {
            let mut bytes = [0; 4096];
            let error = error.as_mut().expect("a pipe");
            while let Ok(count @ 1..) = error.read(&mut bytes) {
                let text = String::from_utf8_lossy(&bytes[..count]);
                into.lock().expect("no panic").push_str(&text);
            }
        });
        Self {
            commands: child.stdin.take(),
            child,
            lines,
            seen: Vec::new(),
            errors,
            pictures,
        }
    }

    /// Waits for the next line of this event that is as wished.
    pub(crate) fn wait_for(&mut self, event: &str, wished: impl Fn(&Value) -> bool) -> Value {
        let mut heard = Instant::now();
        loop {
            let line = match self.lines.recv_timeout(LOOK) {
                Ok(line) => line,
                Err(RecvTimeoutError::Timeout) if heard.elapsed() < LONGEST_WAIT => {
                    assert_all_live();
                    continue;
                }
                Err(_) => {
                    assert_all_live();
                    panic!("no `{event}` came:\n{}", self.story());
                }
            };
            heard = Instant::now();
            self.seen.push(line.clone());
            if line["event"] == event && wished(&line) {
                return line;
            }
        }
    }

    /// Waits until so many frames were shown in all, and the session is focused.
    pub(crate) fn wait_for_frames(&mut self, frames: u64) -> Value {
        self.wait_for("shown", |line| {
            line["frames"].as_u64() >= Some(frames) && line["life"] == "focused"
        })
    }

    /// Frames that it has reported as shown.
    pub(crate) fn frames(&mut self) -> u64 {
        self.seen.extend(self.lines.try_iter());
        let frames = self.seen.iter().filter_map(|line| line["frames"].as_u64());
        frames.max().unwrap_or(0)
    }

    /// Gives a command, and returns the answer.
    pub(crate) fn ask(&mut self, what: &str, name: &str) -> Value {
        let commands = self.commands.as_mut().expect("steered");
        if let Err(why) = writeln!(commands, "{what} {name}") {
            panic!("{what} {name}: {why}\n{}", self.story());
        }
        self.wait_for("told", |line| line["name"] == name)
    }

    /// Moves head and hands, and waits until the program's frames have them. The tests check how near they are.
    pub(crate) fn take_pose(&mut self, head: &mut Head, scripted: &Scripted) {
        head.send(scripted);
        for _ in 0..100 {
            let told = self.ask("tell", "where");
            let place: Vec<f64> = numbers(&told["head"]["position"]);
            let turn: Vec<f64> = numbers(&told["head"]["rotation"]);
            let pose = scripted.stage_from_head;
            let apart = (place.iter().zip(pose.position.to_array()))
                .map(|(got, sent)| (got - f64::from(sent)).abs())
                .fold(0.0, f64::max);
            let alike = (turn.iter().zip(pose.rotation.to_array()))
                .map(|(got, sent)| got * f64::from(sent))
                .sum::<f64>();
            if apart < 0.01 && alike.abs() > 0.9999 {
                return;
            }
        }
        panic!("the head does not follow:\n{}", self.story());
    }

    /// Reads both eyes' pictures of the next frame.
    pub(crate) fn read(&mut self, name: &str) -> (Value, [RgbaImage; 2]) {
        let told = self.ask("read", name);
        let pictures = ["left", "right"].map(|eye| {
            let file: PathBuf = self.pictures.path().join(format!("{name}-{eye}.png"));
            let picture = image::open(&file);
            picture
                .unwrap_or_else(|why| panic!("{}: {why}", file.display()))
                .into_rgba8()
        });
        (told, pictures)
    }

    /// Its process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Lets a steered program end.
    pub(crate) fn end(&mut self) {
        self.commands = None;
    }

    /// Waits for its end.
    pub(crate) fn ended(mut self) -> Ended {
        let mut heard = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                break status;
            }
            assert_all_live();
            while let Ok(line) = self.lines.try_recv() {
                heard = Instant::now();
                self.seen.push(line);
            }
            assert!(
                heard.elapsed() < LONGEST_WAIT,
                "it does not end:\n{}",
                self.story()
            );
            thread::sleep(LOOK);
        };
        // The pipe is closed by now: this ends.
        while let Ok(line) = self.lines.recv_timeout(LONGEST_WAIT) {
            self.seen.push(line);
        }
        Ended {
            status,
            lines: std::mem::take(&mut self.seen),
            errors: self.errors.lock().expect("no panic").clone(),
        }
    }

    /// Waits for its end, which is to be a good one; returns its last line.
    pub(crate) fn ended_well(self) -> Value {
        let Ended {
            status,
            lines,
            errors,
        } = self.ended();
        let last = lines.last().cloned().unwrap_or_default();
        assert!(status.success(), "{status}: {last}\n{errors}");
        assert_eq!(last["event"], "over", "the last line: {last}");
        assert_eq!(
            last["validation_messages"], 0,
            "validation messages:\n{errors}"
        );
        if lines.iter().any(|line| line["validated"] == false) {
            let must = std::env::var("CI").as_deref() == Ok("true");
            assert!(!must, "CI must have Vulkan's validation layer");
            println!("skipped: validation: no layer on this machine");
        }
        last
    }

    fn story(&self) -> String {
        let lines: Vec<String> = self.seen.iter().map(Value::to_string).collect();
        let errors = self.errors.lock().expect("no panic");
        format!("{}\n{errors}", lines.join("\n"))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It has ended as a rule.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Ended {
    /// Its last line.
    pub(crate) fn last(&self) -> &Value {
        self.lines.last().unwrap_or(&Value::Null)
    }
}
