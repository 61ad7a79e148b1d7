//! What can go wrong between a graph and its results.

use std::path::PathBuf;

/// An error of the inference runtime.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RuntimeError {
    /// No usable ONNX Runtime library.
    #[error(
        "cannot load ONNX Runtime from {}: {reason}; start through ./run, or set ORT_DYLIB_PATH to the libonnxruntime \
         of release 1.24 or newer (the onnxruntime wheel on PyPI holds one)",
        path.display()
    )]
    Library {
        /// The library that was tried.
        path: PathBuf,
        /// Why it did not load.
        reason: String,
    },
    /// ONNX Runtime refused the graph.
    #[error("ONNX Runtime cannot load the graph")]
    Graph(#[source] ort::Error),
    /// The graph has not the inputs or outputs that its caller needs.
    #[error("the graph's {side} {name} is {got}, but {expected} is needed")]
    Signature {
        /// "input" or "output".
        side: &'static str,
        /// Its name.
        name: String,
        /// What the graph declares.
        got: String,
        /// What the caller needs.
        expected: String,
    },
    /// A run failed.
    #[error("ONNX Runtime failed to run the graph")]
    Run(#[source] ort::Error),
}
