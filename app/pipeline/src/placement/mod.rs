//! Which unit each stage runs on: what is asked for, what is to be had, what is fastest.

mod choice;
mod first;
mod inference;
mod plan;
mod trial;

pub use choice::{Alternative, StageCosts, choose, predicted_picture_ms};
pub use first::place_first;
pub use inference::{Fault, Inference, ProviderChange, ProviderChanges};
pub use plan::{PlacementRequest, Plan, unit_of};
pub use trial::{Offer, Placed, PlacementReport, place};
