//! The results of a profiled call: a table, JSON, a page for any browser, a trace; and the machine's temperatures and
//! clocks meanwhile.
//!
//! `app` measures; this crate writes the results, the same on a desktop and on a headset. It opens no call and draws nothing.

#![forbid(unsafe_code)]

mod files;
pub mod machine;
mod measured;
mod memory;
mod page;
mod report;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tests;
mod trace;

pub use files::{FINISHED, Files, Folder, WriteError};
pub use measured::{Measured, SessionTerms};
pub use memory::{Memory, resident_bytes};
pub use report::{AvatarFigures, Conditions, Report};
