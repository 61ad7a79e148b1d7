//! What can go wrong between a camera and what was seen in its pictures.

use npu_runtime::RuntimeError;
use std::path::PathBuf;

/// The environment variable that names the folder of the tracking networks.
pub const NETWORKS_VARIABLE: &str = "MON3TR_NETWORKS";

/// An error of the tracker.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackerError {
    /// A picture whose size and bytes do not fit.
    #[error(
        "a picture of {width} x {height} pixels came with {bytes} bytes: it needs at least one pixel, and three bytes for each; check \
         the source of pictures"
    )]
    Picture {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// The bytes that came.
        bytes: usize,
    },
    /// The folder of the networks is not known.
    #[error(
        "{NETWORKS_VARIABLE} does not name the folder of the tracking networks: start through ./run, which fetches them with `./run setup`"
    )]
    NoFolder,
    /// Networks are missing.
    #[error("the folder {} of the tracking networks lacks {names}: fetch them with `./run setup`", folder.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// The files, separated by commas.
        names: String,
    },
    /// A network's file cannot be read.
    #[error("cannot read the tracking network {}: fetch it anew with `./run setup`", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A network's file cannot be converted.
    #[error("the tracking network {} cannot be converted to ONNX: fetch it anew with `./run setup`", path.display())]
    Convert {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: tflite_to_onnx::ConvertError,
    },
    /// A network has other inputs or outputs than its user needs.
    #[error(
        "the tracking network {network} has {got}, but {expected} is needed: it is another network of that name; fetch it anew with \
         `./run setup`"
    )]
    Shape {
        /// The network's name.
        network: String,
        /// What it has.
        got: String,
        /// What it should have.
        expected: String,
    },
    /// The runtime failed to load or run a network.
    #[error("the tracking network {network} cannot be run")]
    Runtime {
        /// The network's name.
        network: String,
        /// Why.
        #[source]
        source: RuntimeError,
    },
    /// A network of the user's is not as its description says, or that says what cannot be.
    #[error(
        "cannot use the network that {} describes: {reason}; docs/models.md says how a network is described",
        path.display()
    )]
    Description {
        /// The description.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The runtime failed to load or run a network of the user's.
    #[error(
        "the network {} cannot be run: try it with ONNX Runtime alone, and export it with operators that ONNX Runtime has",
        path.display()
    )]
    Custom {
        /// The network's file.
        path: PathBuf,
        /// Why.
        #[source]
        source: RuntimeError,
    },
    /// A thread could not be started.
    #[error(
        "the system refused a thread for the tracker's {unit}; end other programs, or raise the limit of threads"
    )]
    Thread {
        /// What it was for.
        unit: &'static str,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A thread of the tracker is gone.
    #[error(
        "the tracker's thread for {unit} has ended, so nothing more can be tracked: start the camera anew, and report its log"
    )]
    Stopped {
        /// What it was for.
        unit: &'static str,
    },
}
