//! Holding the display's rate: answers what quality to draw the next picture with, from what the last ones took.
//!
//! Pure logic: no thread, no clock of its own, no allocation after it is made. Time passes in display periods, as the
//! pictures tell. It does not measure, draw or leave anything out; the GPU's lane asks it once a picture.
//!
//! Quality falls along one declared [`LADDER`]: first the resolution, then fewer Gaussians by importance, then a sort every
//! other picture. It falls fast, but not for one outlier, and straight to the first step that is predicted to hold. It comes
//! back one step at a time, only after calm and only where the prediction says that the better step will hold; each climb
//! that fails doubles the calm that the next one takes, so that it never swings between two steps.

mod controller;
mod figures;
mod ladder;
mod recent;
#[cfg(test)]
mod tests;

pub use controller::{MOST_CHANGES_A_MINUTE, QualityController};
pub use figures::{Change, QualityFigures, Reason, StepFigures};
pub use ladder::{KEPT_SHARES, LADDER, Quality, QualityMode};
pub use recent::PictureCost;
