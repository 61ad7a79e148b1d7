//! The folder of the networks, as set-up fetched them.

use crate::error::{NETWORKS_VARIABLE, TrackerError};
use npu_runtime::{Runtime, TensorSpec};
use std::path::{Path, PathBuf};
use tflite_to_onnx::{Options, Port, convert};

/// The files' ending.
const ENDING: &str = "tflite";

/// The largest file that is read: the largest network has 7 MB.
const MOST_BYTES: u64 = 64 << 20;

/// A folder of networks, and the runtime for them.
#[derive(Debug, Clone)]
pub struct NetworkSet {
    folder: PathBuf,
    runtime: Runtime,
}

/// A network as ONNX, in memory.
#[derive(Debug, Clone)]
pub(super) struct Graph {
    pub(super) onnx: Vec<u8>,
    pub(super) inputs: Vec<TensorSpec>,
    pub(super) outputs: Vec<TensorSpec>,
}

impl NetworkSet {
    /// The networks in `folder`, files `*.tflite`, of which all in `names` (without the ending) must be there.
    ///
    /// # Errors
    /// [`TrackerError::Missing`] if one is not.
    pub fn open(folder: &Path, names: &[&str], runtime: &Runtime) -> Result<Self, TrackerError> {
        let set = Self {
            folder: folder.to_path_buf(),
            runtime: runtime.clone(),
        };
        let missing: Vec<String> = names
            .iter()
            .filter(|name| !set.path(name).is_file())
            .map(|name| format!("{name}.{ENDING}"))
            .collect();
        if !missing.is_empty() {
            return Err(TrackerError::Missing {
                folder: set.folder,
                names: missing.join(", "),
            });
        }
        Ok(set)
    }

    /// The folder that the environment names.
    ///
    /// # Errors
    /// [`TrackerError::NoFolder`] if it names none.
    pub fn folder_of_environment() -> Result<PathBuf, TrackerError> {
        std::env::var_os(NETWORKS_VARIABLE)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
            .ok_or(TrackerError::NoFolder)
    }

    /// What runs the networks.
    #[must_use]
    pub fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.{ENDING}"))
    }

    /// Network `name` with only the outputs at `places` of its file.
    pub(super) fn onnx(&self, name: &str, places: &[usize]) -> Result<Graph, TrackerError> {
        let path = self.path(name);
        let tflite = read(&path)?;
        let options = Options {
            outputs: Some(places.to_vec()),
        };
        let converted =
            convert(&tflite, &options).map_err(|source| TrackerError::Convert { path, source })?;
        let specs = |ports: &[Port]| {
            ports
                .iter()
                .map(|port| TensorSpec::new(&port.name, &port.shape))
                .collect()
        };
        Ok(Graph {
            inputs: specs(&converted.inputs),
            outputs: specs(&converted.outputs),
            onnx: converted.onnx,
        })
    }
}

fn read(path: &Path) -> Result<Vec<u8>, TrackerError> {
    use std::io::Read;
    let fail = |source| TrackerError::Read {
        path: path.to_path_buf(),
        source,
    };
    let file = std::fs::File::open(path).map_err(fail)?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(fail)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(fail(std::io::Error::other(format!(
            "it has more than {MOST_BYTES} bytes"
        ))));
    }
    Ok(bytes)
}
