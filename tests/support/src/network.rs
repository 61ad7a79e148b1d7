//! ONNX networks of two pictures, written node by node: for tests of what reads networks.

use onnx_schema::{Attribute, Graph, Model, Node, OperatorSet, Tensor, ValueInfo};
use prost::Message;

/// A network while it is written.
#[derive(Debug, Clone)]
pub struct Net {
    /// The version of ONNX's operators.
    pub opset: i64,
    /// All of it but the version.
    pub graph: Graph,
    names: usize,
}

impl Net {
    /// Of two pictures `a` and `b` of one shape.
    #[must_use]
    pub fn new(opset: i64, picture: &[i64]) -> Self {
        let graph = Graph {
            name: Some("network".into()),
            input: vec![
                ValueInfo::float("a", picture),
                ValueInfo::float("b", picture),
            ],
            ..Graph::default()
        };
        Self {
            opset,
            graph,
            names: 0,
        }
    }

    fn fresh(&mut self) -> String {
        self.names += 1;
        format!("v{}", self.names)
    }

    /// An operator's first output.
    pub fn node(&mut self, op: &str, inputs: &[&str], attributes: &[Attribute]) -> String {
        let output = self.fresh();
        self.graph.node.push(Node {
            input: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: vec![output.clone()],
            op_type: Some(op.into()),
            attribute: attributes.to_vec(),
            ..Node::default()
        });
        output
    }

    /// A stored tensor.
    pub fn floats(&mut self, dims: &[i64], values: &[f32]) -> String {
        self.stored(Tensor::floats(dims, values))
    }

    /// A stored list.
    pub fn ints(&mut self, values: &[i64]) -> String {
        self.stored(Tensor::ints(values))
    }

    fn stored(&mut self, tensor: Tensor) -> String {
        let name = self.fresh();
        self.graph.initializer.push(Tensor {
            name: Some(name.clone()),
            ..tensor
        });
        name
    }

    /// Chance around 0, of a stored tensor.
    pub fn weights(&mut self, dims: &[i64], scale: f32, rng: &mut fastrand::Rng) -> String {
        let count: i64 = dims.iter().product();
        let values: Vec<f32> = (0..count)
            .map(|_| scale * (2.0 * rng.f32() - 1.0))
            .collect();
        self.floats(dims, &values)
    }

    /// A reduction over `axes`, as this opset has it; over all where there are none.
    pub fn reduce(&mut self, op: &str, value: &str, axes: &[i64], keep: bool) -> String {
        let inputs_from = if op == "ReduceSum" { 13 } else { 18 };
        let keepdims = Attribute::int("keepdims", i64::from(keep));
        if axes.is_empty() {
            self.node(op, &[value], &[keepdims])
        } else if self.opset < inputs_from {
            self.node(op, &[value], &[Attribute::ints("axes", axes), keepdims])
        } else {
            let axes = self.ints(axes);
            self.node(op, &[value, &axes], &[keepdims])
        }
    }

    /// `Squeeze` or `Unsqueeze`, as this opset has it.
    pub fn squeeze(&mut self, op: &str, value: &str, axes: &[i64]) -> String {
        if self.opset < 13 {
            self.node(op, &[value], &[Attribute::ints("axes", axes)])
        } else {
            let axes = self.ints(axes);
            self.node(op, &[value, &axes], &[])
        }
    }

    /// Makes `value` the output.
    pub fn output(&mut self, value: &str, shape: &[i64]) {
        self.graph.output = vec![ValueInfo::float(value, shape)];
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> Vec<u8> {
        self.model().encode_to_vec()
    }

    /// The file, decoded.
    #[must_use]
    pub fn model(&self) -> Model {
        Model {
            ir_version: Some(7),
            producer_name: Some("test".into()),
            graph: Some(self.graph.clone()),
            opset_import: vec![OperatorSet {
                domain: Some(String::new()),
                version: Some(self.opset),
            }],
        }
    }
}
