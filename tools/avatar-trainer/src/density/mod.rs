//! Gaussians that come and go (Kerbl et al., 2023, section 5.2): split or cloned where pictures pull at them most, left out where nothing is
//! seen of them, within a budget.
//!
//! [`Statistics`] gathers how hard pictures pull at each Gaussian, [`plan`] chooses, [`Change`] is the new population: what each
//! Gaussian was before, and what it inherits. Children are bound to the triangle under them, which [`Surface`] finds.

mod change;
mod plan;
mod statistics;
mod surface;

pub use change::{Change, Population, Turn};
pub use plan::{Plan, plan};
pub use statistics::Statistics;
pub use surface::{Foot, Surface};
