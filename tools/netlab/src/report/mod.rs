//! The results of calls over networks: the rows of a measurement, and their table, JSON and charts. Measures nothing itself.

mod bitrate_chart;
mod call_chart;
mod draw;
mod rows;
mod table;

pub use bitrate_chart::bitrate_chart;
pub use call_chart::call_chart;
pub use rows::{BitrateSeries, CallRow, Frames, LatencyMs, Report, VoiceRow, percentile};

#[cfg(test)]
pub(crate) mod samples;
