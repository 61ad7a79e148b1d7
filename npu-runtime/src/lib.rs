//! Runs static ONNX graphs through ONNX Runtime, with preallocated inputs and outputs.
//!
//! It knows tensors, not people: the caller knows what a graph means. Which execution provider runs a graph is a
//! parameter of the session; [`Runtime::probe`] lists the available ones, and no session falls back to another.
//!
//! A graph with one input and one output, run on the CPU:
//!
//! ```no_run
//! use npu_runtime::{Provider, Runtime, Session, TensorSpec};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let runtime = Runtime::open(None)?; // ORT_DYLIB_PATH, or the system's libonnxruntime.so
//! for available in runtime.probe() {
//!     println!("{available}");
//! }
//! let onnx = std::fs::read("model.onnx")?;
//! let (inputs, outputs) = ([TensorSpec::new("x", &[1, 64])], [TensorSpec::new("y", &[1, 8])]);
//! let mut session = Session::new(&runtime, &onnx, Provider::Cpu { threads: 2 }, &inputs, &outputs)?;
//! println!("{} on {}", session.origin(), session.provider());
//! let mut results = session.outputs()?;
//! session.input_mut(0).fill(0.5);
//! session.run(&mut results)?;
//! println!("y = {:?}", results.get(0));
//! # Ok(())
//! # }
//! ```

mod cache;
mod cancel;
mod commit;
mod devices;
mod error;
mod graph;
mod landing;
#[cfg(any(target_os = "android", test))]
mod nnapi_devices;
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
