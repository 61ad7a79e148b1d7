//! Where the milliseconds go: what lanes record ([`Recorder`], [`Collector`]), and what it comes to ([`Summary`]).
//!
//! Files and pictures of it are made elsewhere (`mon3tr profile`).

mod frame_times;
mod latency;
mod occupancy;
mod percentiles;
mod pictures;
mod recorded;
mod recording;
mod stages;
mod summary;
#[cfg(test)]
mod tests;

pub use frame_times::FrameTimes;
pub use latency::{LatencyBreakdown, Part, PartLatency, PictureLatency, Since};
pub use occupancy::{Busy, Occupancy, Overlap};
pub use percentiles::Percentiles;
pub use pictures::{PictureFigures, Quality};
pub use recorded::{Recording, nanoseconds};
pub use recording::{Collector, Event, PictureTimes, Recorder, Span};
pub use stages::{Profile, StageSummary};
pub use summary::{Summary, Terms};
