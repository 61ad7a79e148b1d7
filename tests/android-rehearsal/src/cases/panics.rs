//! A panic in the library as it is packaged, stripped of its symbols: the log has to be enough to find the line.

use super::activities::shows_a_notice;
use super::{Figures, figure};
use crate::environment::Environment;
use android_rehearsal::protocol::{Callback, Intent};
use anyhow::{Context, ensure};
use std::path::Path;
use std::process::Command;
use test_support::monado::Compositor;

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let mut process = scene.process()?;
    let activity = process.launch(Intent::default())?;
    shows_a_notice(&mut process)?;
    process.call(activity, Callback::NativeWindowDestroyed)?;
    // Android promises not to send this for a destroyed window; android-activity relies on it, and panics.
    let ended = process.call(activity, Callback::NativeWindowResized);
    ensure!(ended.is_err(), "the app did not panic");
    let logcat = process.logcat();
    let place = between(&logcat, "panic at ", " on the thread")
        .with_context(|| format!("the panic is not in the log:\n{logcat}"))?;
    let (file, line) = place
        .rsplit_once(':')
        .and_then(|(place, _column)| place.rsplit_once(':'))
        .context("the panic has no place")?;
    // The documented command, with the log's lines alone.
    let addresses = addresses(&logcat);
    ensure!(!addresses.is_empty(), "the log has no addresses:\n{logcat}");
    let lines = lines_of(&environment.app.symbols, &addresses)?;
    let wanted = format!(
        "{}:{line}",
        Path::new(file).file_name().unwrap_or_default().display()
    );
    ensure!(
        lines.contains(&wanted),
        "none of the addresses is {wanted}, where the panic was:\n{lines}"
    );
    let mut figures = Figures::new();
    figure(&mut figures, "panic", place);
    figure(&mut figures, "addresses", addresses.len());
    Ok(figures)
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    Some(text.split_once(before)?.1.split_once(after)?.0)
}

/// What stands behind `libmain.so` in the lines of the way.
fn addresses(logcat: &str) -> Vec<&str> {
    let rest = logcat.split(" libmain.so 0x").skip(1);
    rest.filter_map(|rest| rest.split_whitespace().next())
        .collect()
}

/// The command in docs/android.md.
fn lines_of(symbols: &Path, addresses: &[&str]) -> anyhow::Result<String> {
    let output = Command::new("addr2line")
        .args(["-f", "-C", "-i", "-e"])
        .arg(symbols)
        .args(addresses)
        .output()
        .context("addr2line could not be started: apt-get install binutils")?;
    ensure!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
