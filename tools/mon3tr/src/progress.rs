//! Progress bars for anything longer than a second.

use indicatif::{ProgressBar, ProgressStyle};
use reconstruct::bake::Progress;
use std::io::IsTerminal;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// A bar of `steps` steps labelled `what`. Where standard error is no terminal, one line says what begins.
pub fn bar(what: &str, steps: usize) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        eprintln!("{what} ...");
    }
    let bar = ProgressBar::new(steps as u64).with_message(what.to_owned());
    let template = "{msg:<24} {bar:32} {pos}/{len}  {elapsed} (about {eta} left)";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// A sign of life for a step whose length is not known. Where standard error is no terminal, one line says what begins.
pub(crate) fn spinner(what: &str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        eprintln!("{what} ...");
    }
    let bar = ProgressBar::new_spinner().with_message(what.to_owned());
    if let Ok(style) = ProgressStyle::with_template("{msg} {spinner} {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A bar for bytes that are transferred, which shows once there are any.
#[derive(Debug, Clone)]
pub(crate) struct Bytes {
    what: &'static str,
    bar: Arc<OnceLock<ProgressBar>>,
}

/// A bar of bytes labelled `what`.
pub(crate) fn bytes(what: &'static str) -> Bytes {
    Bytes {
        what,
        bar: Arc::default(),
    }
}

impl Bytes {
    /// Shows `done` of `total` bytes.
    pub(crate) fn show(&self, done: u64, total: u64) {
        let bar = self.bar.get_or_init(|| {
            let bar = bar(self.what, 0);
            let template = "{msg:<24} {bar:32} {bytes}/{total_bytes}  {bytes_per_sec} ({eta} left)";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar
        });
        bar.set_length(total);
        bar.set_position(done);
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}

/// How often a step tells how far it is where standard error is no terminal.
const TOLD_EVERY: Duration = Duration::from_secs(10);

/// A step's bar, and when something was said of it last.
type Step = (ProgressBar, Instant);

/// One bar per step of a bake, one after the other.
#[derive(Debug, Default)]
pub(crate) struct Bars {
    current: Mutex<Option<Step>>,
}

impl Bars {
    /// Removes the last step's bar.
    pub(crate) fn finish(&self) {
        self.replace(None);
    }

    fn replace(&self, next: Option<Step>) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((done, _)) = std::mem::replace(&mut *current, next) {
            done.finish_and_clear();
        }
    }
}

impl Progress for Bars {
    fn begin(&self, step: &'static str, total: usize) {
        log::info!("bake: {step}");
        self.replace(Some((bar(step, total), Instant::now())));
    }

    fn advance(&self) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((bar, told)) = current.as_mut() else {
            return;
        };
        bar.inc(1);
        if told.elapsed() >= TOLD_EVERY && !std::io::stderr().is_terminal() {
            let length = bar.length().unwrap_or_default();
            eprintln!("{}: {} of {length}", bar.message(), bar.position());
            *told = Instant::now();
        }
    }
}
