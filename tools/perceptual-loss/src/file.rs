//! A network's file, read and checked.

use crate::error::{NetworkError, NetworkFault};
use npu_runtime::TensorSpec;
use onnx_schema::{Model, ValueInfo};
use prost::Message;
use std::collections::HashSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The largest file, bytes.
const MOST_BYTES: u64 = 1 << 30;
/// The longest side of an input, pixels.
const MOST_SIDE: usize = 4096;

/// An ONNX file of pictures [1, 3, height, width] of one size and one output, all of static shapes.
#[derive(Debug, Clone)]
pub struct NetworkFile {
    /// Where it is.
    pub path: PathBuf,
    /// The file.
    pub onnx: Vec<u8>,
    /// The pictures.
    pub inputs: Vec<TensorSpec>,
    /// The output.
    pub output: TensorSpec,
    /// Width and height of each picture, pixels.
    pub size: [usize; 2],
}

impl NetworkFile {
    /// Reads a network of so many pictures.
    ///
    /// # Errors
    /// A file that cannot be read, is too large, no ONNX file, or has other inputs and outputs.
    pub fn read(path: &Path, pictures: usize) -> Result<Self, NetworkError> {
        let read = || {
            let onnx = bytes(path)?;
            let model = Model::decode(&onnx[..]).map_err(NetworkFault::Undecodable)?;
            let (inputs, output, size) = ports(&model, pictures).map_err(NetworkFault::Ports)?;
            Ok(Self {
                path: path.to_path_buf(),
                onnx,
                inputs,
                output,
                size,
            })
        };
        read().map_err(|fault| NetworkError {
            path: path.to_path_buf(),
            fault,
        })
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, NetworkFault> {
    let file = File::open(path).map_err(NetworkFault::Read)?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(NetworkFault::Read)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(NetworkFault::TooLarge { most: MOST_BYTES });
    }
    Ok(bytes)
}

/// Inputs, the output, and the pictures' width and height.
fn ports(
    model: &Model,
    pictures: usize,
) -> Result<(Vec<TensorSpec>, TensorSpec, [usize; 2]), String> {
    let graph = model.graph.as_ref().ok_or("it has no graph")?;
    // Files of old versions list stored tensors among the inputs.
    let stored: HashSet<&str> = (graph.initializer.iter())
        .map(|tensor| tensor.name())
        .collect();
    let free = graph
        .input
        .iter()
        .filter(|port| !stored.contains(port.name()));
    let inputs: Vec<TensorSpec> = free.map(spec).collect::<Result<_, _>>()?;
    let first = inputs.first().ok_or("it has no input")?;
    let &[1, 3, height, width] = &first.shape[..] else {
        return Err(format!(
            "its input {} has the shape {:?}; [1, 3, height, width] is needed",
            first.name, first.shape
        ));
    };
    if inputs.len() != pictures {
        return Err(format!(
            "{pictures} inputs are needed; it has {}",
            inputs.len()
        ));
    }
    if let Some(other) = inputs.iter().find(|input| input.shape != first.shape) {
        return Err(format!(
            "its input {} has the shape {:?} and its input {} {:?}; export it for pictures of one size",
            first.name, first.shape, other.name, other.shape
        ));
    }
    if height.max(width) > MOST_SIDE {
        return Err(format!(
            "its pictures have {width} x {height} pixels; {MOST_SIDE} a side are the most"
        ));
    }
    let [output] = &graph.output[..] else {
        return Err(format!(
            "one output is needed; it has {}",
            graph.output.len()
        ));
    };
    let output = spec(output)?;
    Ok((inputs, output, [width, height]))
}

/// A tensor's name and static shape.
fn spec(port: &ValueInfo) -> Result<TensorSpec, String> {
    let name = port.name.as_deref().unwrap_or_default();
    let tensor = (port.r#type.as_ref()).and_then(|kind| kind.tensor_type.as_ref());
    let shape = tensor.and_then(|tensor| tensor.shape.as_ref());
    let shape = shape.ok_or_else(|| format!("{name} has no shape"))?;
    let sides: Option<Vec<usize>> = (shape.dim.iter())
        .map(|side| {
            usize::try_from(side.dim_value?)
                .ok()
                .filter(|side| *side > 0)
        })
        .collect();
    let sides = sides.ok_or_else(|| {
        format!(
            "{name} has an open side: export the network with static shapes and one picture a run"
        )
    })?;
    Ok(TensorSpec::new(name, &sides))
}
