//! Why a network has no gradient here.

/// Why the gradient of a network cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeriveError {
    /// Not a protobuf message of ONNX's schema.
    #[error("it is no ONNX file")]
    Undecodable(#[source] prost::DecodeError),
    /// A file that is none of a network that can be run from it alone.
    #[error("{0}")]
    Network(String),
    /// More of something than a network of pictures has.
    #[error("it has more {what} than {most}, the most of a network that is derived")]
    TooLarge {
        /// Of what.
        what: &'static str,
        /// How many there may be.
        most: usize,
    },
    /// An operator between the input and the output has no derivative here.
    #[error("the operator {operator} of node {node} cannot be derived: {reason}")]
    Operator {
        /// ONNX's name of the operator.
        operator: String,
        /// The node's name, else that of what it gives.
        node: String,
        /// What stands in the way.
        reason: String,
    },
    /// There is no such input, or the output is the same whatever it is.
    #[error("its output does not depend on its input {0}")]
    Independent(String),
}
