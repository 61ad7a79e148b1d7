//! Visiting people in a headset: from their rooms' links to the last goodbye, as the `receive` command and the app on a headset do.
//!
//! What asks, fetches and shows is all here; where packages are kept, what is printed, and what a panel says meanwhile is the
//! business of whoever visits.

mod arrive;
mod calls;
mod rehearsal;

pub use arrive::{Waiting, unless_over, wait_for_sender};
pub use calls::{Ended, Guest, NetworkContext, Visited, visit};
pub use rehearsal::Rehearsal;
