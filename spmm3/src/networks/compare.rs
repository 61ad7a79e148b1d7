//! Checks that a graph from a package is the very graph that [`DeformGraph`] writes for that package's person.
//!
//! Known operators alone bound nothing: two of them make a matrix of any size out of two short vectors, and ONNX Runtime
//! computes constants when it loads. So the graph is compared, part by part, with what the writer would write; there is no second
//! description of the graph to keep up to date.

use super::graph::head;
use super::inspect::Stored;
use super::inspect::check_tensor;
use super::inspect::find_graph;
use super::wire::Checked;
use super::wire::refuse;
use super::wire::{Fields, Value};
use super::writer::Sink;
use super::{AttributeNetwork, DeformGraph, Dialect, GraphParts, GraphRefused, MeshNetwork};
use crate::{Controllers, Template};
use onnx_schema::{Node, Tensor};
use prost::Message;

/// Most numbers that all stored tensors of a package's graph hold together: 512 MiB once ONNX Runtime has widened them. A person of 60,000
/// Gaussians has 20 million, one of 400,000 has 99 million.
pub const MAX_NUMBERS: usize = 128 << 20;

impl DeformGraph<'_> {
    /// Refuses `model`, which [`super::GraphSignature::read`] has checked, unless it is the graph that [`Self::to_onnx`] writes for `template`,
    /// `controllers` and some networks: the same nodes in the same order, the same stored tensors, and in them this
    /// person's skinning weights, neighbours and masses. The rest shape is stored as a sum with F_mesh's mean offsets,
    /// which must stay within what [`super::QuantisedDecoder::quantise`] takes.
    ///
    /// # Errors
    /// Names the first part that differs.
    pub(crate) fn check(
        model: &[u8],
        template: &Template,
        controllers: &Controllers,
    ) -> Result<(), GraphRefused> {
        check_head(model)?;
        let mut comparison = Comparison::new(find_graph(model)?)?;
        let mesh = MeshNetwork::read(model, template)?;
        let attributes = AttributeNetwork::read(model, controllers)?;
        let expected = DeformGraph {
            template,
            controllers,
            mesh: &mesh,
            attributes: &attributes,
        };
        expected.write(GraphParts::Whole, Dialect::Package, &mut comparison);
        comparison.finish()
    }
}

/// Everything beside the graph: format and operator versions, and nothing more.
fn check_head(model: &[u8]) -> Checked<()> {
    let expected = head().encode_to_vec();
    let mut expected = Fields(&expected);
    for field in Fields(model) {
        let (number, value) = field?;
        if number == GRAPH_FIELD {
            continue;
        }
        if expected.next() != Some(Ok((number, value))) {
            return refuse(format!(
                "field {number} of the model is not as the format has it"
            ));
        }
    }
    match expected.next() {
        None => Ok(()),
        Some(_) => refuse("the model lacks its versions"),
    }
}

/// `ModelProto.graph`.
const GRAPH_FIELD: u64 = 7;

/// The parts of a graph, compared with those that the writer writes, until one differs.
struct Comparison<'a> {
    nodes: std::vec::IntoIter<&'a [u8]>,
    tensors: std::vec::IntoIter<Stored<'a>>,
    outcome: Checked<()>,
}

impl<'a> Comparison<'a> {
    fn new(graph: &'a [u8]) -> Checked<Self> {
        let (mut nodes, mut tensors, mut numbers) = (Vec::new(), Vec::new(), 0usize);
        for field in Fields(graph) {
            match field? {
                (1, Value::Bytes(node)) => nodes.push(node),
                (5, Value::Bytes(tensor)) => {
                    let stored = check_tensor(tensor)?;
                    numbers = numbers.saturating_add(stored.len());
                    tensors.push(stored);
                }
                _ => {}
            }
        }
        if numbers > MAX_NUMBERS {
            return refuse(format!(
                "it stores {numbers} numbers, more than the {MAX_NUMBERS} it may"
            ));
        }
        Ok(Self {
            nodes: nodes.into_iter(),
            tensors: tensors.into_iter(),
            outcome: Ok(()),
        })
    }

    fn finish(mut self) -> Checked<()> {
        self.outcome?;
        if let Some(node) = self.nodes.next() {
            return refuse(format!("{} is one too many", describe(node)));
        }
        match self.tensors.next() {
            None => Ok(()),
            Some(extra) => refuse(format!("stored tensor {:?} is one too many", extra.name())),
        }
    }

    fn check_node(&mut self, expected: &Node) -> Checked<()> {
        let wanted = expected.name.as_deref().unwrap_or_default();
        match self.nodes.next() {
            Some(found) if found == expected.encode_to_vec() => Ok(()),
            Some(found) => refuse(format!(
                "{} stands where the format has node {wanted:?}, or differs from it",
                describe(found)
            )),
            None => refuse(format!("node {wanted:?} is missing")),
        }
    }

    fn check_tensor(&mut self, expected: &Tensor) -> Checked<()> {
        let wanted = expected.name.as_deref().unwrap_or_default();
        let Some(found) = self.tensors.next() else {
            return refuse(format!("stored tensor {wanted:?} is missing"));
        };
        if !found.has_head_of(expected) {
            return refuse(format!(
                "stored tensor {:?} stands where the format has {wanted:?}, or has another type or shape",
                found.name()
            ));
        }
        // Rest shape plus mean, less the rest shape, plus the rest shape: equal but for rounding. What the sum may be is
        // checked where the mean is read.
        let is_sum = wanted == "mesh.canonical";
        if is_sum || expected.raw_data.as_deref() == Some(found.raw()) {
            return Ok(());
        }
        refuse(format!(
            "stored tensor {wanted:?} does not follow from the package's template and controllers"
        ))
    }
}

impl Sink for Comparison<'_> {
    fn node(&mut self, node: Node) {
        if self.outcome.is_ok() {
            self.outcome = self.check_node(&node);
        }
    }

    fn tensor(&mut self, tensor: Tensor) {
        if self.outcome.is_ok() {
            self.outcome = self.check_tensor(&tensor);
        }
    }
}

/// A node in words; its description is known to be short.
fn describe(node: &[u8]) -> String {
    let node = Node::decode(node).unwrap_or_default();
    let text = |part: Option<String>| part.unwrap_or_default();
    format!("node {:?} ({})", text(node.name), text(node.op_type))
}
