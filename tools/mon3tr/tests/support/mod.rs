//! Running the command from a test.

use std::path::Path;
use std::process::Command;

/// How the command ended.
pub struct Outcome {
    ok: bool,
    stdout: String,
    stderr: String,
}

/// `mon3tr` with `arguments`, through `MON3TR_RUNNER` where the machine's C library is too old for the Vulkan driver.
pub fn command(arguments: &[&str]) -> Command {
    let program = env!("CARGO_BIN_EXE_mon3tr");
    let mut command = match std::env::var_os("MON3TR_RUNNER") {
        Some(runner) if !runner.is_empty() => {
            let mut command = Command::new(runner);
            command.arg(program);
            command
        }
        _ => Command::new(program),
    };
    command.args(arguments);
    command
}

/// Runs `mon3tr` with `arguments`.
pub fn mon3tr(arguments: &[&str]) -> Outcome {
    Outcome::of(&mut command(arguments))
}

impl Outcome {
    pub fn of(command: &mut Command) -> Self {
        let output = command.output().expect("the command can be started");
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Self {
            ok: output.status.success(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Standard output of a run that must have ended well.
    pub fn succeeds(self) -> String {
        assert!(self.ok, "the command failed:\n{}", self.stderr);
        self.stdout
    }

    /// The run must have failed with an `error:` line that holds all of `words`, and without a panic.
    pub fn fails_naming(self, words: &[&str]) {
        assert!(
            !self.ok,
            "the command must fail, but printed:\n{}",
            self.stdout
        );
        assert!(
            !self.stderr.contains("panicked"),
            "the command panicked:\n{}",
            self.stderr
        );
        let line = self.stderr.lines().find(|line| line.starts_with("error:"));
        assert!(
            line.is_some(),
            "no line starts with `error:` in:\n{}",
            self.stderr
        );
        for word in words {
            assert!(
                self.stderr.contains(word),
                "`{word}` is missing in:\n{}",
                self.stderr
            );
        }
    }
}

/// The JSON in `path`.
pub fn json(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).expect("the JSON file exists");
    serde_json::from_str(&text).expect("the JSON file is JSON")
}

/// True where no Vulkan device can draw: a failure in CI, a skip that says why elsewhere.
pub fn vulkan_is_missing() -> bool {
    missing(
        xr_renderer::Gpu::open(&xr_renderer::GpuChoice::Auto, false)
            .err()
            .map(|e| e.to_string()),
    )
}

/// True where ONNX Runtime cannot be loaded; as [`vulkan_is_missing`].
pub fn ort_is_missing() -> bool {
    missing(
        npu_runtime::Runtime::open(None)
            .err()
            .map(|e| e.to_string()),
    )
}

fn missing(reason: Option<String>) -> bool {
    let Some(reason) = reason else { return false };
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "this test cannot run here: {reason}"
    );
    println!("skipped: {reason}");
    true
}
