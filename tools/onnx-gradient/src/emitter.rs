//! Nodes that are appended to a network.
//!
//! Constants are nodes too: stored tensors would have to be listed among the inputs in files of old versions.

use crate::shape::{i64_of, i64s};
use onnx_schema::{Attribute, Node, Tensor};

/// What was appended so far. Values are named by a prefix that the network does not use.
#[derive(Debug)]
pub(crate) struct Emitter {
    opset: i64,
    prefix: String,
    nodes: Vec<Node>,
    names: usize,
}

/// The first opset whose `ReduceSum` is told its axes by an input.
const AXES_ARE_INPUTS: i64 = 13;

impl Emitter {
    /// Appends to a network of `opset` whose names are `taken`.
    pub(crate) fn new<'n>(opset: i64, taken: impl Iterator<Item = &'n str>) -> Self {
        const PREFIX: &str = "gradient";
        let dots = |name: &str| name.bytes().take_while(|byte| *byte == b'.').count();
        let alike = taken.filter_map(|name| name.strip_prefix(PREFIX));
        let most = alike.map(dots).max().unwrap_or(0);
        Self {
            opset,
            prefix: format!("{PREFIX}{}", ".".repeat(most + 1)),
            nodes: Vec::new(),
            names: 0,
        }
    }

    fn fresh(&mut self) -> String {
        self.names += 1;
        format!("{}{}", self.prefix, self.names)
    }

    fn push(&mut self, op: &str, inputs: &[&str], outputs: Vec<String>, attributes: &[Attribute]) {
        self.nodes.push(Node {
            input: inputs.iter().map(|&name| name.to_owned()).collect(),
            name: outputs.first().cloned(),
            output: outputs,
            op_type: Some(op.to_owned()),
            attribute: attributes.to_vec(),
            ..Node::default()
        });
    }

    /// What an operator gives.
    pub(crate) fn node(&mut self, op: &str, inputs: &[&str], attributes: &[Attribute]) -> String {
        let output = self.fresh();
        self.push(op, inputs, vec![output.clone()], attributes);
        output
    }

    /// The second thing that an operator gives.
    pub(crate) fn second(&mut self, op: &str, inputs: &[&str], attributes: &[Attribute]) -> String {
        let (first, second) = (self.fresh(), self.fresh());
        self.push(op, inputs, vec![first, second.clone()], attributes);
        second
    }

    fn constant(&mut self, tensor: Tensor) -> String {
        self.node("Constant", &[], &[Attribute::tensor("value", tensor)])
    }

    /// A number.
    pub(crate) fn scalar(&mut self, value: f32) -> String {
        self.constant(Tensor::floats(&[], &[value]))
    }

    /// A list of integers.
    pub(crate) fn ints(&mut self, values: &[i64]) -> String {
        self.constant(Tensor::ints(values))
    }

    /// A shape.
    pub(crate) fn sides(&mut self, shape: &[usize]) -> String {
        self.ints(&i64s(shape))
    }

    /// `value` in another shape.
    pub(crate) fn reshape(&mut self, value: &str, shape: &[usize]) -> String {
        let shape = self.sides(shape);
        self.node("Reshape", &[value, &shape], &[])
    }

    /// `value` repeated to a shape.
    pub(crate) fn expand(&mut self, value: &str, shape: &[usize]) -> String {
        let shape = self.sides(shape);
        self.node("Expand", &[value, &shape], &[])
    }

    /// Sums over `axes`, which stay with a side of 1.
    pub(crate) fn reduce_sum(&mut self, value: &str, axes: &[usize]) -> String {
        if self.opset < AXES_ARE_INPUTS {
            let axes = Attribute::ints("axes", &i64s(axes));
            return self.node("ReduceSum", &[value], &[axes]);
        }
        let axes = self.sides(axes);
        self.node("ReduceSum", &[value, &axes], &[])
    }

    /// `value`'s entries `starts`, `starts` + `steps`, ... before `ends`, along `axes`.
    pub(crate) fn slice(
        &mut self,
        value: &str,
        axes: &[usize],
        starts: &[usize],
        ends: &[usize],
        steps: &[usize],
    ) -> String {
        let lists = [starts, ends, axes, steps].map(|list| self.sides(list));
        let [starts, ends, axes, steps] = &lists;
        self.node("Slice", &[value, starts, ends, axes, steps], &[])
    }

    /// `value` with its `axes` the other way round.
    pub(crate) fn reversed(&mut self, value: &str, axes: &[usize]) -> String {
        let starts = self.ints(&vec![-1; axes.len()]);
        // Before the first entry: -1 would be the last one.
        let ends = self.ints(&vec![i64::MIN; axes.len()]);
        let steps = self.ints(&vec![-1; axes.len()]);
        let axes = self.sides(axes);
        self.node("Slice", &[value, &starts, &ends, &axes, &steps], &[])
    }

    /// The sum of all; nothing of none.
    pub(crate) fn sum(&mut self, values: &[String]) -> Option<String> {
        let (first, rest) = values.split_first()?;
        let add = |sum: String, next: &String| self.node("Add", &[&sum, next], &[]);
        Some(rest.iter().fold(first.clone(), add))
    }

    /// `value` with dimension `order[k]` as dimension `k`.
    pub(crate) fn transposed(&mut self, value: &str, order: &[usize]) -> String {
        let order: Vec<i64> = order.iter().map(|axis| i64_of(*axis)).collect();
        self.node("Transpose", &[value], &[Attribute::ints("perm", &order)])
    }

    /// All nodes, in the order of their execution.
    pub(crate) fn finish(self) -> Vec<Node> {
        self.nodes
    }
}
