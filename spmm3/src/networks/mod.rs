//! F_mesh and F_attr of the paper: their weights, and the one static ONNX graph that holds both and the LBS between.
//!
//! This module describes networks and writes them down; `npu-runtime` runs them and `tools/reconstruct` fits them.

mod attributes;
mod compare;
mod graph;
mod inspect;
mod layer;
mod mesh;
mod onnx;
mod stored;
mod wire;

pub use attributes::{AttributeNetwork, QuantisedBases};
pub use graph::{DeformGraph, input, output};
pub use inspect::{GraphRefused, GraphSignature};
pub use layer::Dense;
pub use mesh::{MeshNetwork, QuantisedDecoder};
