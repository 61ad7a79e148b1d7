//! Runs static ONNX graphs through ONNX Runtime, with preallocated inputs and outputs.
//!
//! It knows tensors, not people: what a graph means is its caller's matter. Which execution provider runs a graph is a
//! parameter of the session; today there is the CPU's.

mod error;
mod runtime;
mod session;

pub use error::RuntimeError;
pub use runtime::Runtime;
pub use session::{Provider, Session, TensorSpec};
