//! Runs static ONNX graphs through ONNX Runtime, with preallocated inputs and outputs.
//!
//! It knows tensors, not people: the caller knows what a graph means. Which execution provider runs a graph is a
//! parameter of the session; [`Runtime::probe`] lists the available ones, and no session falls back to another.

mod cache;
mod cancel;
mod commit;
mod devices;
mod error;
mod graph;
mod landing;
mod provider;
mod qnn;
mod runtime;
mod session;
mod tensors;

pub use cancel::Cancel;
pub use commit::compile;
pub use error::RuntimeError;
pub use graph::{Graph, Origin, Precompiled};
pub use landing::Landing;
pub use provider::{Provider, ProviderKind, QnnTarget, UnknownProvider, UnknownTarget};
pub use qnn::QNN_VARIABLE;
pub use runtime::{Availability, Runtime};
pub use session::Session;
pub use tensors::{Outputs, TensorSpec};
