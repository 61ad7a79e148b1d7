//! A member of a call of several, who is its sender and a viewer of everyone else: what the `mon3tr` command and the app on a headset share.

mod members;
mod roster;
mod wearer;

pub use members::{Member, Members};
pub use roster::{Guest, Roster, RosterFigures};
pub use wearer::{WEARER_RATE, WearerCapture};
