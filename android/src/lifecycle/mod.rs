//! Android's life-cycle, as commands for the call: begin, stop drawing at once, go on, make room, leave.
//!
//! [`Machine`] decides and touches nothing; [`Driver`] lets a [`Receiver`] do what was decided. Windows and focus decide nothing: a
//! headset's pictures go to its compositor, not to the activity's window, and whether they are seen is the OpenXR session's state
//! (`docs/android.md`).

mod driver;
mod event;
mod machine;
#[cfg(test)]
mod tests;

pub use driver::{Driver, Receiver};
pub use event::Event;
pub use machine::{Command, Machine, Oddity, Step, Trim};
