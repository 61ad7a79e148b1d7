//! The network's operators as nodes of ONNX.
//!
//! TensorFlow Lite stores pictures as number, height, width, channels, ONNX as number, channels, height, width: every computed tensor of
//! four dimensions has ONNX's order here, and is turned back only where an operator or an output sees the order of its values.

mod arithmetic;
mod arrange;
mod face;
mod reduce;
mod window;

use crate::Converted;
use crate::array::{Array, integers};
use crate::error::ConvertError;
use crate::graph::{Builder, Value};
use crate::model::{Element, Kind, Model, Operator, Tensor};

/// Where each dimension of a picture in TensorFlow Lite's order is in ONNX's.
const PICTURE: [i64; 4] = [0, 2, 3, 1];
/// Where each dimension of a picture in ONNX's order is in TensorFlow Lite's.
const STORED: [usize; 4] = [0, 3, 1, 2];

/// `model` as ONNX, with the outputs numbered `keep`, or all.
pub(crate) fn emit(model: &Model<'_>, keep: Option<&[usize]>) -> Result<Converted, ConvertError> {
    let all: Vec<usize> = (0..model.outputs.len()).collect();
    let keep = keep.unwrap_or(&all);
    let kept = keep
        .iter()
        .map(|k| model.outputs.get(*k).map(|tensor| (*k, *tensor)))
        .collect::<Option<Vec<_>>>()
        .filter(|kept| !kept.is_empty() && keep.is_sorted_by(|a, b| a < b))
        .ok_or_else(|| ConvertError::Outputs {
            asked: keep.to_vec(),
            count: model.outputs.len(),
        })?;
    let live = live(model, &kept);
    let mut emitter = Emitter {
        model,
        graph: Builder::default(),
        values: vec![None; model.tensors.len()],
        sources: vec![None; model.tensors.len()],
        at: 0,
    };
    for (k, &tensor) in model.inputs.iter().enumerate() {
        let shape = emitter.port(format!("input {k}"), tensor)?;
        let shape = match *shape {
            [n, h, w, c] => vec![n, c, h, w],
            _ => shape.to_vec(),
        };
        let value = emitter.graph.input(format!("in{k}"), shape);
        emitter.set(tensor, value);
    }
    for (at, operator) in model.operators.iter().enumerate() {
        if live.get(at) == Some(&true) {
            emitter.at = at;
            emitter.operator(operator)?;
        }
    }
    // A constant that cannot be read is then reported as of no operator's.
    emitter.at = model.operators.len();
    for (k, tensor) in kept {
        let shape = emitter.port(format!("output {k}"), tensor)?.to_vec();
        let value = emitter.stored(tensor)?;
        emitter.graph.output(value, format!("out{k}"), shape);
    }
    Ok(emitter.graph.finish())
}

/// For each operator, whether a kept output needs it.
fn live(model: &Model<'_>, kept: &[(usize, usize)]) -> Vec<bool> {
    let mut needed = vec![false; model.tensors.len()];
    for (_, tensor) in kept {
        mark(&mut needed, *tensor);
    }
    let mut live = vec![false; model.operators.len()];
    for (flag, operator) in live.iter_mut().zip(&model.operators).rev() {
        *flag = operator
            .outputs
            .iter()
            .any(|tensor| needed.get(*tensor) == Some(&true));
        if *flag {
            for tensor in operator.inputs.iter().flatten() {
                mark(&mut needed, *tensor);
            }
        }
    }
    live
}

fn mark(needed: &mut [bool], tensor: usize) {
    if let Some(flag) = needed.get_mut(tensor) {
        *flag = true;
    }
}

/// The graph so far, and what became of each tensor.
struct Emitter<'a> {
    model: &'a Model<'a>,
    graph: Builder,
    /// Of each tensor, once it is computed; pictures in ONNX's order.
    values: Vec<Option<Value>>,
    /// Of each tensor that is a constant in another form: the constant.
    sources: Vec<Option<usize>>,
    /// The operator at hand.
    at: usize,
}

impl<'a> Emitter<'a> {
    /// The shape of a network's input or output, which must be floats.
    fn port(&self, port: String, tensor: usize) -> Result<&'a [usize], ConvertError> {
        match self.model.tensors.get(tensor) {
            Some(found) if found.element == Element::Float32 && !found.shape.contains(&0) => {
                Ok(&found.shape)
            }
            _ => Err(ConvertError::Port { port }),
        }
    }

    fn unsupported(&self, why: impl Into<String>) -> ConvertError {
        let kind = self.model.operators.get(self.at).map(|found| &found.kind);
        ConvertError::Unsupported {
            operator: self.at,
            name: match kind {
                Some(Kind::Other(name)) => name.clone(),
                Some(kind) => format!("{kind:?}"),
                None => "none".into(),
            },
            why: why.into(),
        }
    }

    fn set(&mut self, tensor: usize, value: Value) {
        if let Some(place) = self.values.get_mut(tensor) {
            *place = Some(value);
        }
    }

    fn operator(&mut self, op: &Operator<'_>) -> Result<(), ConvertError> {
        let [output] = op.outputs[..] else {
            return Err(self.unsupported("it has not one output"));
        };
        if matches!(op.kind, Kind::Dequantize | Kind::Densify) {
            let input = self.input(op, 0)?;
            let source = self.source(input);
            if self.tensor(source)?.data.is_empty() {
                return Err(self.unsupported("its input is no constant"));
            }
            if let Some(place) = self.sources.get_mut(output) {
                *place = Some(source);
            }
            return Ok(());
        }
        if self.tensor(output)?.element != Element::Float32 {
            return Err(self.unsupported("its result is not of 32-bit floats"));
        }
        let value = match &op.kind {
            Kind::Conv => window::convolve(self, op)?,
            Kind::DepthwiseConv => window::convolve_depthwise(self, op)?,
            Kind::MaxPool => window::pool(self, op, "MaxPool")?,
            Kind::AveragePool => window::pool(self, op, "AveragePool")?,
            Kind::Add => arithmetic::binary(self, op, "Add")?,
            Kind::Sub => arithmetic::binary(self, op, "Sub")?,
            Kind::Mul => arithmetic::binary(self, op, "Mul")?,
            Kind::Div => arithmetic::binary(self, op, "Div")?,
            Kind::SquaredDifference => arithmetic::squared_difference(self, op)?,
            Kind::Prelu => arithmetic::prelu(self, op)?,
            Kind::Relu => arithmetic::unary(self, op, "Relu")?,
            Kind::Relu6 => arithmetic::relu6(self, op)?,
            Kind::HardSwish => arithmetic::unary(self, op, "HardSwish")?,
            Kind::Logistic => arithmetic::unary(self, op, "Sigmoid")?,
            Kind::Neg => arithmetic::unary(self, op, "Neg")?,
            Kind::Sqrt => arithmetic::unary(self, op, "Sqrt")?,
            Kind::Rsqrt => arithmetic::rsqrt(self, op)?,
            Kind::Mean => reduce::reduce(self, op, "ReduceMean")?,
            Kind::Sum => reduce::reduce(self, op, "ReduceSum")?,
            Kind::FullyConnected => reduce::fully_connected(self, op)?,
            Kind::Concatenation => arrange::concatenate(self, op)?,
            Kind::DepthToSpace => arrange::depth_to_space(self, op)?,
            Kind::Pad => arrange::pad(self, op)?,
            Kind::Reshape => arrange::reshape(self, op)?,
            Kind::ResizeBilinear => arrange::resize_bilinear(self, op)?,
            Kind::StridedSlice => arrange::strided_slice(self, op)?,
            Kind::Transpose => arrange::transpose(self, op)?,
            Kind::LandmarksToTransform => face::landmarks_to_transform(self, op)?,
            Kind::TransformTensor => face::transform_tensor(self, op)?,
            Kind::TransformLandmarks => face::transform_landmarks(self, op)?,
            Kind::Dequantize | Kind::Densify | Kind::Other(_) => {
                return Err(self.unsupported("this kind is not known"));
            }
        };
        self.set(output, value);
        Ok(())
    }

    /// Input `k`, which must be there.
    fn input(&self, op: &Operator<'_>, k: usize) -> Result<usize, ConvertError> {
        op.inputs
            .get(k)
            .copied()
            .flatten()
            .ok_or_else(|| self.unsupported(format!("it lacks its input {k}")))
    }

    /// Input `k` if there is one.
    fn optional(op: &Operator<'_>, k: usize) -> Option<usize> {
        op.inputs.get(k).copied().flatten()
    }

    /// The shape of the output.
    fn output_shape(&self, op: &Operator<'_>) -> &'a [usize] {
        op.outputs.first().map_or(&[], |tensor| self.shape(*tensor))
    }

    fn shape(&self, tensor: usize) -> &'a [usize] {
        self.model
            .tensors
            .get(tensor)
            .map_or(&[], |tensor| &tensor.shape)
    }

    /// The shape of a picture: number, height, width, channels.
    fn picture(&self, shape: &[usize]) -> Result<[usize; 4], ConvertError> {
        shape
            .try_into()
            .ok()
            .filter(|shape: &[usize; 4]| !shape.contains(&0))
            .ok_or_else(|| self.unsupported(format!("the shape {shape:?} is not a picture's")))
    }

    fn tensor(&self, tensor: usize) -> Result<&'a Tensor<'a>, ConvertError> {
        self.model
            .tensors
            .get(tensor)
            .ok_or_else(|| self.unsupported("a tensor is missing"))
    }

    /// The constant that `tensor` is, or is another form of.
    fn source(&self, tensor: usize) -> usize {
        self.sources
            .get(tensor)
            .copied()
            .flatten()
            .unwrap_or(tensor)
    }

    fn is_constant(&self, tensor: usize) -> bool {
        self.tensor(self.source(tensor))
            .is_ok_and(|source| !source.data.is_empty())
    }

    /// The floats of a constant, in TensorFlow Lite's order.
    fn floats(&mut self, tensor: usize) -> Result<Array, ConvertError> {
        let source = self.tensor(self.source(tensor))?;
        if source.data.is_empty() {
            return Err(self.unsupported("it has an input that is no constant where one is needed"));
        }
        if source.shape != self.shape(tensor) {
            return Err(ConvertError::damaged(
                "a constant has two shapes, before and after it is unpacked",
            ));
        }
        self.graph
            .reserve(source.shape.iter().product::<usize>().saturating_mul(4))?;
        Array::floats(source)
    }

    /// The integers of a constant.
    fn ints(&self, tensor: usize) -> Result<Vec<i64>, ConvertError> {
        let tensor = self.tensor(tensor)?;
        if tensor.data.is_empty() {
            return Err(self.unsupported("it has an input that is no constant where one is needed"));
        }
        integers(tensor)
    }

    /// A constant's floats as a value, a picture's in ONNX's order.
    fn constant(&mut self, array: Array) -> Result<Value, ConvertError> {
        let array = match array.shape.len() {
            4 => array.permuted(STORED)?,
            _ => array,
        };
        Ok(self.graph.floats(&array.shape, &array.values))
    }

    /// A tensor as a value, a picture's in ONNX's order.
    fn value(&mut self, tensor: usize) -> Result<Value, ConvertError> {
        if let Some(value) = self.values.get(tensor).copied().flatten() {
            return Ok(value);
        }
        if !self.is_constant(tensor) {
            return Err(self.unsupported("it has an input that was not computed before it"));
        }
        let array = self.floats(tensor)?;
        self.constant(array)
    }

    /// A tensor as a value in TensorFlow Lite's order.
    fn stored(&mut self, tensor: usize) -> Result<Value, ConvertError> {
        let value = self.value(tensor)?;
        Ok(match *self.shape(tensor) {
            // One channel or one pixel: the same order, so that nothing moves.
            [n, h, w, c] if c == 1 || h * w == 1 => self.graph.reshape(value, &[n, h, w, c]),
            [_, _, _, _] => self.graph.transpose(value, &PICTURE),
            _ => value,
        })
    }

    /// A value of `shape` in TensorFlow Lite's order, in ONNX's.
    fn turned_from_stored(&mut self, value: Value, shape: &[usize]) -> Value {
        match *shape {
            [n, h, w, c] if c == 1 || h * w == 1 => self.graph.reshape(value, &[n, c, h, w]),
            [_, _, _, _] => self.graph.transpose(value, &[0, 3, 1, 2]),
            _ => value,
        }
    }
}
