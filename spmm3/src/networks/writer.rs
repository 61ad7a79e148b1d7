//! Nodes and stored tensors, one after the other, for whoever takes them: a file's writer, or a comparison with another file.

use super::Dense;
use super::parts::Dialect;
use onnx_schema::{Attribute, Graph, Node, Tensor, data_type};

/// Sizes in this crate stay far below `i64::MAX`.
pub(super) fn dim(size: usize) -> i64 {
    i64::try_from(size).unwrap_or(i64::MAX)
}

/// Receives the parts of a graph: to write them, or to compare another graph with them.
pub(super) trait Sink {
    fn node(&mut self, node: Node);
    fn tensor(&mut self, tensor: Tensor);
}

impl Sink for Graph {
    fn node(&mut self, node: Node) {
        self.node.push(node);
    }

    fn tensor(&mut self, tensor: Tensor) {
        self.initializer.push(tensor);
    }
}

/// Makes nodes and stored tensors; every method returns the name of the value it made.
pub(super) struct Writer<'s> {
    pub(super) sink: &'s mut dyn Sink,
    pub(super) dialect: Dialect,
}

impl Writer<'_> {
    pub(super) fn op(
        &mut self,
        op: &str,
        name: &str,
        inputs: &[&str],
        attributes: &[Attribute],
    ) -> String {
        self.op_named(op, &format!("{name}.out"), inputs, attributes)
    }

    pub(super) fn op_named(
        &mut self,
        op: &str,
        output: &str,
        inputs: &[&str],
        attributes: &[Attribute],
    ) -> String {
        self.sink.node(Node {
            input: inputs.iter().map(|i| (*i).to_owned()).collect(),
            output: vec![output.to_owned()],
            name: Some(format!("{output}.{op}")),
            op_type: Some(op.to_owned()),
            attribute: attributes.to_vec(),
            ..Node::default()
        });
        output.to_owned()
    }

    pub(super) fn dense(&mut self, name: &str, x: &str, layer: &Dense) -> String {
        let (inputs, outputs) = (dim(layer.inputs()), dim(layer.outputs()));
        let weights = self.half(
            &format!("{name}.weights"),
            &[inputs, outputs],
            layer.weights(),
        );
        let bias = self.float(&format!("{name}.bias"), &[outputs], layer.bias());
        self.op("Gemm", name, &[x, &weights, &bias], &[])
    }

    pub(super) fn silu(&mut self, name: &str, x: &str) -> String {
        let gate = self.op("Sigmoid", &format!("{name}.gate"), &[x], &[]);
        self.op("Mul", &format!("{name}.silu"), &[x, &gate], &[])
    }

    /// Stored numbers, each so many times as large: what a mean of so many is taken of where their sum is wanted.
    pub(super) fn times(&mut self, name: &str, stored: &str, count: i64) -> String {
        #[expect(clippy::cast_precision_loss, reason = "a few dozen")]
        let count = self.float(&format!("{name}.count"), &[1], &[count as f32]);
        let name = format!("{name}.times");
        self.op("Mul", &name, &[stored, &count], &[])
    }

    /// The mean over the second axis, which is left out, named `out`.
    pub(super) fn mean(&mut self, out: &str, x: &str) -> String {
        // Up to opset 17 the axes of a mean are an attribute; those of a sum are an input since 13.
        let attributes = [Attribute::ints("axes", &[1]), Attribute::int("keepdims", 0)];
        self.op_named("ReduceMean", out, &[x], &attributes)
    }

    /// Rows `from..to` of a matrix.
    pub(super) fn slice(&mut self, name: &str, x: &str, from: i64, to: i64) -> String {
        let starts = self.int64(&format!("{name}.from"), &[from]);
        let ends = self.int64(&format!("{name}.to"), &[to]);
        let axes = self.int64(&format!("{name}.axis"), &[0]);
        self.op("Slice", name, &[x, &starts, &ends, &axes], &[])
    }

    fn tensor(&mut self, name: &str, kind: i32, dims: &[i64], raw: Vec<u8>) -> String {
        self.sink.tensor(Tensor {
            dims: dims.to_vec(),
            data_type: Some(kind),
            name: Some(name.to_owned()),
            raw_data: Some(raw),
            ..Tensor::default()
        });
        name.to_owned()
    }

    pub(super) fn float(&mut self, name: &str, dims: &[i64], values: &[f32]) -> String {
        self.tensor(
            name,
            data_type::FLOAT,
            dims,
            values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        )
    }

    pub(super) fn int32(&mut self, name: &str, dims: &[i64], values: &[i32]) -> String {
        self.tensor(
            name,
            data_type::INT32,
            dims,
            values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        )
    }

    /// A one-dimensional list of 64-bit integers: a shape or slice bound.
    pub(super) fn int64(&mut self, name: &str, values: &[i64]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.tensor(name, data_type::INT64, &[dim(values.len())], raw)
    }

    /// FP16 constants, widened to FP32.
    pub(super) fn half(&mut self, name: &str, dims: &[i64], values: &[half::f16]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let stored = self.tensor(name, data_type::FLOAT16, dims, raw);
        self.widened(name, &stored)
    }

    /// 8-bit constants, widened to FP32.
    pub(super) fn int8(&mut self, name: &str, dims: &[i64], values: &[i8]) -> String {
        let stored = self.tensor(
            name,
            data_type::INT8,
            dims,
            bytemuck::cast_slice(values).to_vec(),
        );
        self.widened(name, &stored)
    }

    fn widened(&mut self, name: &str, stored: &str) -> String {
        let to = [Attribute::int("to", i64::from(data_type::FLOAT))];
        self.op("Cast", &format!("{name}.f32"), &[stored], &to)
    }
}
