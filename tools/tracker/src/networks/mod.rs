//! The tracking networks: where they are, their conversion to ONNX, and running one on a region of a picture.

mod network;
mod set;

pub use network::{Network, Signature};
pub use set::NetworkSet;

/// The logistic function. Infinite numbers count as large ones.
pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x.clamp(-100.0, 100.0)).exp())
}
