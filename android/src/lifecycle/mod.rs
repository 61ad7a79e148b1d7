//! Android's life-cycle, as commands for the call: begin, stop drawing at once, continue, free memory, leave.
//!
//! [`Machine`] decides; [`Driver`] lets a [`Receiver`] execute the commands. Windows and focus have no effect: a
//! headset's pictures go to its compositor, not to the activity's window, and whether they are seen is the OpenXR session's state
//! (`docs/android.md`).
//!
//! android-activity answers Android before it hands an event on: when `onPause` returns, the app has just begun to pause. It takes one
//! event after the other, so the GPU rests when the answer to the next one comes: `onStop`, or that the window goes.

mod driver;
mod event;
mod machine;
#[cfg(test)]
mod tests;

pub use driver::{Driver, Receiver};
pub use event::Event;
pub use machine::{Command, Machine, Oddity, Step, Trim};
