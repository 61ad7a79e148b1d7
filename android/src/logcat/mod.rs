//! The log: everything under one tag, `mon3tr`, and panics with their backtrace before the process ends.

#[cfg(target_os = "android")]
mod android;
mod frames;
mod lines;
mod panics;

#[cfg(target_os = "android")]
pub use android::start;
pub use lines::{LONGEST_LINE, lines};
pub use panics::log_panics;

/// The tag: `adb logcat -s mon3tr`.
pub const TAG: &str = "mon3tr";
