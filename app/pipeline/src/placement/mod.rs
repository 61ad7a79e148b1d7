//! Which unit each stage runs on: what is asked for, what is to be had, what is fastest.

mod canvas;
mod choice;
mod first;
mod later;
mod report;
mod trial;

pub use choice::{Alternative, StageCosts, choose, predicted_picture_ms};
pub use first::place_first;
pub use later::place_like;
pub use report::PlacementReport;
pub use trial::{InferenceBackends, Placed, place};
