//! The deform graph on QNN's emulator of the Hexagon V69, the Quest 3's NPU: wholly there, right, and compiled once.
//!
//! The emulator computes as the chip does, but its times say nothing about the chip's.

mod compiled;
mod error_against_f64;
mod refused;

use npu_runtime::{Graph, Provider, QnnTarget, Runtime, RuntimeError, Session};
use synthetic_person::Puppet;
use test_support::onnx::whole_graph;

/// The Quest 3's NPU.
const QNN: Provider = Provider::Qnn {
    target: QnnTarget::SXR2230P,
};

/// The puppet's whole deform graph, in whatever forms `graph` has it, on the NPU.
fn session(runtime: &Runtime, puppet: &Puppet, graph: Graph<'_>) -> Result<Session, RuntimeError> {
    let (inputs, outputs) = whole_graph(puppet.template.vertices().len(), puppet.gaussians.len());
    Session::new(runtime, graph, QNN, &inputs, &outputs)
}
