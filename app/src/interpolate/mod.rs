//! Pictures between motion frames: at any display rate, from any motion rate (paper, section IV-C: 30 to 60 frames a second).

mod timeline;

pub use timeline::{LatencyMode, Timeline};
