//! What a profiled call came to, for whoever ran it: a table, JSON, a page for any browser, a trace; and the machine's heat and
//! clocks meanwhile.
//!
//! `app` measures; this writes it down, the same on a desktop and on a headset. It opens no call and draws nothing.

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
