//! Progress bars for anything longer than a second.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `steps` steps labelled `what`. Invisible where standard error is no terminal.
pub(crate) fn bar(what: &str, steps: usize) -> ProgressBar {
    let bar = ProgressBar::new(steps as u64).with_message(what.to_owned());
    if let Ok(style) =
        ProgressStyle::with_template("{msg:<24} {bar:32} {pos}/{len}  {elapsed} (about {eta} left)")
    {
        bar.set_style(style);
    }
    bar
}
