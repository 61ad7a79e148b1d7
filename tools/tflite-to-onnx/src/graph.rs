//! An ONNX graph while it is built: nodes in the order of their execution, constants, names.

use crate::error::ConvertError;
use crate::{Converted, Port};
use onnx_schema::{Attribute, Graph, Model, Node, OperatorSet, Tensor, ValueInfo, data_type};

/// Most bytes of all constants: the networks that this converter is for have 13 MB at most.
const MAX_BYTES: usize = 1 << 27;
/// Opset 20 is the first whose GridSample knows `linear`.
const OPSET: i64 = 20;
const IR_VERSION: i64 = 9;

/// A value of the graph, to be used as a node's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Value(Option<usize>);

impl Value {
    /// An optional input that is left out.
    pub(crate) const NONE: Self = Self(None);
}

/// The graph so far.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    names: Vec<String>,
    nodes: Vec<Node>,
    constants: Vec<Tensor>,
    bytes: usize,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
}

/// A dimension or index as ONNX writes it. All that are used are far smaller.
pub(crate) fn i64_of(value: usize) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

fn i64s(values: &[usize]) -> Vec<i64> {
    values.iter().map(|value| i64_of(*value)).collect()
}

impl Builder {
    fn value(&mut self, name: String) -> Value {
        self.names.push(name);
        Value(Some(self.names.len() - 1))
    }

    fn fresh(&mut self) -> Value {
        self.value(format!("v{}", self.names.len()))
    }

    fn name(&self, value: Value) -> String {
        let name = value.0.and_then(|index| self.names.get(index));
        name.cloned().unwrap_or_default()
    }

    /// Sets `bytes` aside before they are allocated.
    ///
    /// # Errors
    /// [`ConvertError::TooLarge`] if all constants become too large.
    pub(crate) fn reserve(&mut self, bytes: usize) -> Result<(), ConvertError> {
        self.bytes = self.bytes.saturating_add(bytes);
        if self.bytes > MAX_BYTES {
            return Err(ConvertError::TooLarge {
                what: format!("its constants have more than {MAX_BYTES} bytes"),
                limit: MAX_BYTES,
            });
        }
        Ok(())
    }

    fn constant(&mut self, dims: Vec<i64>, data_type: i32, raw: Vec<u8>) -> Value {
        let value = self.fresh();
        self.constants.push(Tensor {
            dims,
            data_type: Some(data_type),
            name: Some(self.name(value)),
            raw_data: Some(raw),
            ..Tensor::default()
        });
        value
    }

    /// A constant of floats, whose memory was set aside by [`Self::reserve`] if there is much of it.
    pub(crate) fn floats(&mut self, shape: &[usize], values: &[f32]) -> Value {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(i64s(shape), data_type::FLOAT, raw)
    }

    /// A number.
    pub(crate) fn scalar(&mut self, value: f32) -> Value {
        self.floats(&[], &[value])
    }

    /// A list of integers.
    pub(crate) fn ints(&mut self, values: &[i64]) -> Value {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(vec![i64_of(values.len())], data_type::INT64, raw)
    }

    /// A node of kind `op` with one output, which is returned.
    pub(crate) fn node(&mut self, op: &str, inputs: &[Value], attributes: Vec<Attribute>) -> Value {
        let output = self.fresh();
        self.push(op, inputs, output, attributes);
        output
    }

    fn push(&mut self, op: &str, inputs: &[Value], output: Value, attribute: Vec<Attribute>) {
        self.nodes.push(Node {
            input: inputs.iter().map(|value| self.name(*value)).collect(),
            output: vec![self.name(output)],
            name: None,
            op_type: Some(op.into()),
            attribute,
            ..Node::default()
        });
    }

    /// `value` in another shape.
    pub(crate) fn reshape(&mut self, value: Value, shape: &[usize]) -> Value {
        let shape = self.ints(&i64s(shape));
        self.node("Reshape", &[value, shape], Vec::new())
    }

    /// `value` with dimension `order[k]` as dimension `k`.
    pub(crate) fn transpose(&mut self, value: Value, order: &[i64]) -> Value {
        self.node("Transpose", &[value], vec![Attribute::ints("perm", order)])
    }

    /// An input of the graph.
    pub(crate) fn input(&mut self, name: String, shape: Vec<usize>) -> Value {
        self.inputs.push(Port {
            name: name.clone(),
            shape,
        });
        self.value(name)
    }

    /// Makes `value` an output of the graph.
    pub(crate) fn output(&mut self, value: Value, name: String, shape: Vec<usize>) {
        self.outputs.push(Port {
            name: name.clone(),
            shape,
        });
        let output = self.value(name);
        self.push("Identity", &[value], output, Vec::new());
    }

    /// The model as bytes.
    pub(crate) fn finish(self) -> Converted {
        let infos = |ports: &[Port]| {
            let info = |port: &Port| ValueInfo::float(&port.name, &i64s(&port.shape));
            ports.iter().map(info).collect()
        };
        let model = Model {
            ir_version: Some(IR_VERSION),
            producer_name: Some(env!("CARGO_PKG_NAME").into()),
            graph: Some(Graph {
                node: self.nodes,
                name: Some("network".into()),
                initializer: self.constants,
                input: infos(&self.inputs),
                output: infos(&self.outputs),
            }),
            opset_import: vec![OperatorSet {
                domain: Some(String::new()),
                version: Some(OPSET),
            }],
        };
        Converted {
            onnx: prost::Message::encode_to_vec(&model),
            inputs: self.inputs,
            outputs: self.outputs,
        }
    }
}
