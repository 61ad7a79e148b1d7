//! Why a network cannot judge pictures.

use npu_runtime::RuntimeError;
use onnx_gradient::DeriveError;
use std::path::PathBuf;

/// Why a network's file cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("cannot use the network {}", path.display())]
pub struct NetworkError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub fault: NetworkFault,
}

/// What is wrong with a network's file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkFault {
    /// It cannot be read.
    #[error("it cannot be read")]
    Read(#[source] std::io::Error),
    /// It is larger than any network of pictures.
    #[error("it has more than {most} bytes, the most of a network")]
    TooLarge {
        /// How many it may have.
        most: u64,
    },
    /// It is no ONNX file.
    #[error("it is no ONNX file")]
    Undecodable(#[source] prost::DecodeError),
    /// Inputs or outputs that are not what a judge of pictures has.
    #[error("{0}")]
    Ports(String),
    /// It has no gradient.
    #[error("its gradient, which a training needs, cannot be computed")]
    Gradient(#[source] DeriveError),
    /// ONNX Runtime does not take it.
    #[error("ONNX Runtime refuses it")]
    Session(#[source] RuntimeError),
}
