//! Running the command, and programs of others.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Variables by which a user's own NDK would be taken.
const NDK: [&str; 4] = [
    "ANDROID_NDK_HOME",
    "ANDROID_NDK_ROOT",
    "ANDROID_HOME",
    "ANDROID_SDK_ROOT",
];

/// `mon3tr-dev apk` with `arguments`, on a machine without an NDK, which keeps its key in `keys`.
pub(crate) fn apk(keys: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mon3tr-dev"));
    for name in NDK {
        command.env_remove(name);
    }
    command
        .env_remove("ANDROID_SERIAL")
        .env("MON3TR_CACHE", keys)
        .arg("apk")
        .args(arguments);
    command
}

/// All that a program printed.
pub(crate) fn text(output: &Output) -> String {
    format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// Runs a program that must end well; what it printed to the standard output.
pub(crate) fn output_of(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{command:?}: {}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A program of Android's; nothing, after a line that says so, where they are missing. On CI that is a failure.
pub(crate) fn android(program: &str) -> Option<Command> {
    let folder = variable("MON3TR_ANDROID_TOOLS")?;
    Some(Command::new(folder.join(program)))
}

/// A path in the environment; nothing, after a line that says so, where it is missing. On CI that is a failure.
pub(crate) fn variable(name: &str) -> Option<PathBuf> {
    let found = std::env::var_os(name).map(PathBuf::from);
    if found.is_none() {
        skip(&format!("there is no {name} (./run test sets it)"));
    }
    found
}

/// Says why a test is skipped; on CI that is a failure.
pub(crate) fn skip(why: &str) {
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "{why}, and CI must have it"
    );
    println!("skipped: {why}");
}
