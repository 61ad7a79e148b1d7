//! Reverse-mode differentiation of a static ONNX network whose one output is a number, by one of its inputs.
//!
//! Inference runtimes have no backward pass. [`append_gradient`] writes it as ordinary nodes: what any runtime that runs the network runs as
//! well. Nodes are appended to the file's bytes, which stay as they are (protobuf joins messages that follow one another), and derived is only
//! what lies between the input and the output.
//!
//! Operators that can be derived are those of convolutional networks that compare features ([`OPERATORS`]), at opsets 11 to 22. Where a
//! function has a kink, the derivative is PyTorch's: 0 of `Relu` at 0, that of the first maximum of a `MaxPool`. The derivative of a square root at 0 is 0,
//! so that the norm of a vector of zeros pulls nowhere; there, PyTorch gives no number.

#![forbid(unsafe_code)]

mod constant;
mod emitter;
mod error;
mod network;
mod operator;
mod reverse;
mod shape;

pub use error::DeriveError;
pub use operator::OPERATORS;

use network::Network;
use onnx_schema::{Graph, Model, ValueInfo};
use prost::Message;

/// A network with its gradient.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WithGradient {
    /// The ONNX file: the network's inputs; its output, then the gradient.
    pub onnx: Vec<u8>,
    /// The gradient's name.
    pub gradient: String,
    /// Its shape: the input's.
    pub shape: Vec<usize>,
}

/// Gives the ONNX file `onnx` a second output: the derivatives of its only output, which has one number, by its `input`.
///
/// # Errors
/// A file that is no ONNX network or keeps its weights elsewhere, open shapes, control flow, more nodes or numbers than a network of pictures has, an output that does
/// not depend on the input, and an operator between the two that cannot be derived, by name.
pub fn append_gradient(onnx: &[u8], input: &str) -> Result<WithGradient, DeriveError> {
    let model = Model::decode(onnx).map_err(DeriveError::Undecodable)?;
    let network = Network::read(&model)?;
    let gradient = reverse::gradient(&network, input)?;
    let shape = network.shape(input).unwrap_or_default().to_vec();
    let appended = Model {
        graph: Some(Graph {
            node: gradient.nodes,
            output: vec![ValueInfo::float(&gradient.output, &shape::i64s(&shape))],
            ..Graph::default()
        }),
        ..Model::default()
    };
    let mut bytes = Vec::with_capacity(onnx.len() + appended.encoded_len());
    bytes.extend_from_slice(onnx);
    bytes.extend(appended.encode_to_vec());
    Ok(WithGradient {
        onnx: bytes,
        gradient: gradient.output,
        shape,
    })
}
