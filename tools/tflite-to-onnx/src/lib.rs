//! TensorFlow Lite models as ONNX graphs: what the camera's networks need.
//!
//! [`convert`] is fast enough to be done in memory whenever a program starts, so that networks stay the files that their authors
//! publish. It knows networks of 32-bit or 16-bit floats and static shapes, whose constants may be sparse, made of ADD, AVERAGE_POOL_2D,
//! CONCATENATION, CONV_2D, DENSIFY, DEPTHWISE_CONV_2D, DEPTH_TO_SPACE, DEQUANTIZE, DIV, FULLY_CONNECTED, HARD_SWISH, LOGISTIC,
//! MAX_POOL_2D, MEAN, MUL, NEG, PAD, PRELU, RELU, RELU6, RESHAPE, RESIZE_BILINEAR, RSQRT, SQRT, SQUARED_DIFFERENCE, STRIDED_SLICE, SUB,
//! SUM, TRANSPOSE, and MediaPipe's Landmarks2TransformMatrix, TransformTensorBilinear and TransformLandmarks.
//!
//! A file is read as a stranger's: every offset is checked, and memory and time are bounded.
//!
//! A network of MediaPipe's, of which two outputs are kept, as ONNX Runtime takes it:
//!
//! ```no_run
//! use npu_runtime::{Provider, Runtime, Session, TensorSpec};
//! use tflite_to_onnx::{Options, Port, convert};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let tflite = std::fs::read("pose_landmark_full.tflite")?;
//! // Landmarks and their score; the mask of the person's outline is the larger part of the work, and is left out.
//! let network = convert(&tflite, &Options { outputs: Some(vec![0, 1]) })?;
//! println!("{:?} -> {:?}", network.inputs, network.outputs);
//! let specs = |ports: &[Port]| -> Vec<TensorSpec> { ports.iter().map(|port| TensorSpec::new(&port.name, &port.shape)).collect() };
//! let mut session = Session::new(
//!     &Runtime::open(None)?,
//!     &network.onnx,
//!     Provider::Cpu { threads: 1 },
//!     &specs(&network.inputs),
//!     &specs(&network.outputs),
//! )?;
//! let mut outputs = session.outputs()?;
//! session.input_mut(0).fill(0.5);
//! session.run(&mut outputs)?;
//! println!("the first landmark: {:?}", &outputs.get(0)[..3]);
//! # Ok(())
//! # }
//! ```
//!
//! What is no network is refused:
//!
//! ```
//! use tflite_to_onnx::{ConvertError, Options, convert};
//!
//! let refused = convert(b"a picture of a cat, perhaps", &Options::default());
//! assert_eq!(refused, Err(ConvertError::NotTflite));
//! ```

#![forbid(unsafe_code)]

mod array;
mod emit;
mod error;
mod flatbuffer;
mod flexbuffer;
mod graph;
mod model;
mod sparse;

pub use error::ConvertError;

/// How to convert.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// The outputs to keep, by their rising numbers in the TensorFlow Lite model; what only the others need is left out. Nothing keeps
    /// all of them.
    pub outputs: Option<Vec<usize>>,
}

/// An input or output of the converted network: a tensor of 32-bit floats.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// The name in the graph.
    pub name: String,
    /// The static shape, outermost dimension first.
    pub shape: Vec<usize>,
}

/// A converted network.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    /// The ONNX model (IR version 9, opset 20), whose constants are within it.
    pub onnx: Vec<u8>,
    /// `in0`, `in1`, ... in the TensorFlow Lite model's order. Of a picture, which is number, height, width, channels there, the shape is
    /// number, channels, height, width.
    pub inputs: Vec<Port>,
    /// The outputs that were kept, each named `out` and its number in the TensorFlow Lite model, with the shape and order of values that
    /// it has there (channels last).
    pub outputs: Vec<Port>,
}

/// The TensorFlow Lite model `tflite` (a file's bytes) as an ONNX model.
///
/// # Errors
/// [`ConvertError`] if the file is damaged or holds what is not known, or an output is asked for that there is not.
pub fn convert(tflite: &[u8], options: &Options) -> Result<Converted, ConvertError> {
    let model = model::Model::read(tflite)?;
    emit::emit(&model, options.outputs.as_deref())
}
