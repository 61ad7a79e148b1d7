//! The tracking networks: where they are, their conversion to ONNX, and running one on a region of a picture.

mod network;
mod set;

pub use network::{Network, Signature};
pub use set::NetworkSet;
