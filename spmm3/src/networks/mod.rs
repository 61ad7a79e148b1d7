//! F_mesh and F_attr of the paper: their weights, and the one static ONNX graph that holds both and the LBS between.
//!
//! This module describes networks and writes them as ONNX; `npu-runtime` runs them and `tools/reconstruct` fits them.

mod attributes;
mod compare;
mod compiled;
mod graph;
mod inspect;
mod layer;
mod mesh;
mod parts;
mod stored;
mod wire;
mod writer;

pub use attributes::{AttributeNetwork, QuantisedBases};
pub use compare::MAX_NUMBERS;
pub use compiled::CompiledGraph;
pub(crate) use compiled::check_compiled;
pub use graph::DeformGraph;
pub use inspect::GraphSignature;
pub use layer::Dense;
pub use mesh::{MeshNetwork, QuantisedDecoder};
pub use parts::{Dialect, GraphParts, GraphPorts, GraphSizes, Port, input, output};
pub use wire::GraphRefused;
