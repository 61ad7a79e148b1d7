//! What a picture will take on a headset that is not here.
//!
//! Three things are multiplied:
//! - [`Work`]: how much there is to do for a picture, *counted* in the lists that the renderer made of it on whatever device is here;
//! - [`ShaderCosts`]: how many instructions each shader issues for that, as a *compiler* for the headset's GPU says (`tools/adreno-table`);
//! - [`Chip`]: how fast the chip does such things, as *published*, or measured by others on its relatives.
//!
//! The result is a *model*, not a measurement: every figure of it is an [`Estimate`], the least and the most beside the likely one. It leaves out what
//! nobody has published, such as how the driver schedules. What it is good for: which stage is the longest and why, and what would have to shrink.

#![forbid(unsafe_code)]

mod chip;
mod estimate;
mod networks;
mod processors;
mod shader_costs;
mod stages;
mod work;

pub use chip::{Chip, QUEST_3};
pub use estimate::Estimate;
pub use networks::networks;
pub use processors::{Person, ProcessorTimes};
pub use shader_costs::{ShaderCosts, TableError};
pub use stages::{Limit, StageEstimate, drawing, posing, showing, uploading};
pub use work::{ViewWork, Work};
