//! Networks of a user's own that judge pictures: LPIPS (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018)
//! as a loss that a training can follow. None comes with this repository.
//!
//! [`NetworkFile`] reads and checks a file; [`Lpips`] appends its gradient (`onnx-gradient`) and runs both on the CPU.

#![forbid(unsafe_code)]

mod error;
mod file;
mod lpips;

pub use error::NetworkError;
pub use file::NetworkFile;
pub use lpips::Lpips;
