//! What can go wrong between a graph and its results.

use crate::{ProviderKind, QnnTarget};
use std::path::PathBuf;

/// What to do where there is no library: in a headset only the app can be installed.
const HAVE_A_LIBRARY: &str = if cfg!(target_os = "android") {
    "the app's package lacks it: install the app anew"
} else {
    "start through ./run, or set ORT_DYLIB_PATH to the libonnxruntime of release 1.24 or newer (the onnxruntime wheel on PyPI holds \
     one)"
};

/// An error of the inference runtime.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RuntimeError {
    /// No usable ONNX Runtime library.
    #[error(
        "cannot load ONNX Runtime from {}: {reason}; {HAVE_A_LIBRARY}",
        path.display()
    )]
    Library {
        /// The library that was tried.
        path: PathBuf,
        /// Why it did not load.
        reason: String,
    },
    /// The provider is not available here.
    #[error("the {provider} execution provider cannot be used here: {reason}")]
    Unavailable {
        /// Which one.
        provider: ProviderKind,
        /// Why, and what to do.
        reason: String,
    },
    /// A provider that must run everything does not take some of the graph.
    #[error(
        "the {provider} execution provider does not take all of the graph ({nodes}), and no part of it may go to the CPU \
         unseen: run the graph on the CPU as a whole, or build it from operators that {provider} has"
    )]
    Refused {
        /// Which one.
        provider: ProviderKind,
        /// The nodes it refused, as far as its log names them.
        nodes: String,
        /// What ONNX Runtime says.
        #[source]
        source: ort::Error,
    },
    /// Compiled graphs are there, but for other chips.
    #[error(
        "the graph was compiled for {found}, but {wanted} is to run it: compile it for {wanted} (`mon3tr bake --qnn \
         {wanted}`), or hand over the plain graph too"
    )]
    Target {
        /// What the compiled graph is for.
        found: String,
        /// What the session is for.
        wanted: QnnTarget,
    },
    /// [`crate::Cancel::cancel`] was called before the graph was loaded.
    #[error("loading the graph was cancelled")]
    Cancelled,
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
    /// A compiled graph cannot be kept.
    #[error("cannot write the compiled graph {}; is the disk full, or the folder not writable?", path.display())]
    Cache {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A run failed.
    #[error("ONNX Runtime failed to run the graph")]
    Run(#[source] ort::Error),
}
