//! A network as it is read: each value's shape, small constants, and what each node does.

use crate::constant::{Constant, dims};
use crate::error::DeriveError;
use crate::operator::{self, Known};
use crate::shape::{MOST_RANK, elements};
use onnx_schema::{Graph, Model, Node, Tensor, ValueInfo, data_location, data_type};
use std::collections::HashSet;
use std::ops::RangeInclusive;

/// Most nodes, and most stored tensors. VGG16's LPIPS has under 200.
const MOST_PARTS: usize = 4096;
/// Most inputs, and most outputs, of a node.
const MOST_PORTS: usize = 256;
/// Most numbers of all values together: several times those of VGG16's LPIPS at 1024 x 1024.
const MOST_ELEMENTS: usize = 1 << 31;
/// Versions of ONNX's operators whose derivatives are known.
const OPSETS: RangeInclusive<i64> = 11..=22;
/// `AttributeProto.AttributeType` of graphs within a node.
const SUBGRAPHS: [i32; 2] = [5, 10];

/// A network whose nodes come in the order of their execution and give each value once.
#[derive(Debug)]
pub(crate) struct Network<'m> {
    pub(crate) opset: i64,
    pub(crate) nodes: Vec<Step<'m>>,
    /// The name of its only output, which has one number.
    pub(crate) output: &'m str,
    known: Known<'m>,
    names: HashSet<&'m str>,
}

/// A node.
#[derive(Debug)]
pub(crate) struct Step<'m> {
    pub(crate) node: &'m Node,
    /// What it does, or why that is not known: of no matter for nodes that are not derived.
    pub(crate) operator: Result<operator::Operator, String>,
}

/// A file that is no network that can be derived, for a stated reason.
fn refused<T>(reason: impl Into<String>) -> Result<T, DeriveError> {
    Err(DeriveError::Network(reason.into()))
}

/// Numbers of a value, if it is none of an absurd shape.
fn size(shape: &[usize]) -> Option<usize> {
    let sides = shape.len() <= MOST_RANK && shape.iter().all(|side| *side <= MOST_ELEMENTS);
    elements(shape).filter(|_| sides)
}

/// A float tensor's static shape.
fn declared(port: &ValueInfo) -> Result<(&str, Vec<usize>), DeriveError> {
    let name = port.name.as_deref().unwrap_or_default();
    let tensor = port
        .r#type
        .as_ref()
        .and_then(|kind| kind.tensor_type.as_ref());
    let Some(tensor) = tensor.filter(|tensor| tensor.elem_type == Some(data_type::FLOAT)) else {
        return refused(format!("{name} is no tensor of 32-bit floats"));
    };
    let sides = tensor.shape.iter().flat_map(|shape| &shape.dim);
    let sides: Option<Vec<usize>> = sides
        .map(|side| {
            usize::try_from(side.dim_value?)
                .ok()
                .filter(|side| *side > 0)
        })
        .collect();
    match sides.filter(|_| tensor.shape.is_some()) {
        Some(sides) => Ok((name, sides)),
        None => refused(format!(
            "{name} has an open side: export the network with static shapes"
        )),
    }
}

/// The version of ONNX's own operators.
fn opset(model: &Model) -> Result<i64, DeriveError> {
    let ours = |domain: Option<&str>| matches!(domain, None | Some("" | "ai.onnx"));
    let own = model
        .opset_import
        .iter()
        .find(|set| ours(set.domain.as_deref()));
    let version = own.and_then(|set| set.version).unwrap_or_default();
    if OPSETS.contains(&version) {
        return Ok(version);
    }
    refused(format!(
        "it is of opset {version}; export it with one of {} to {}",
        OPSETS.start(),
        OPSETS.end()
    ))
}

impl<'m> Network<'m> {
    /// Reads a model.
    ///
    /// # Errors
    /// As [`crate::append_gradient`] has them, but for what becomes known only between its input and output.
    pub(crate) fn read(model: &'m Model) -> Result<Self, DeriveError> {
        let opset = opset(model)?;
        let Some(graph) = &model.graph else {
            return refused("it has no graph");
        };
        if graph.node.len().max(graph.initializer.len()) > MOST_PARTS {
            return Err(DeriveError::TooLarge {
                what: "nodes or stored tensors",
                most: MOST_PARTS,
            });
        }
        let mut network = Self {
            opset,
            nodes: Vec::with_capacity(graph.node.len()),
            output: "",
            known: Known::default(),
            names: HashSet::new(),
        };
        for tensor in &graph.initializer {
            network.stored(tensor)?;
        }
        let mut budget = MOST_ELEMENTS;
        for port in &graph.input {
            // Files of old versions list stored tensors among the inputs.
            let name = port.name.as_deref().unwrap_or_default();
            if !network.known.shapes.contains_key(name) {
                let (name, shape) = declared(port)?;
                network.name(name)?;
                network.shaped(name, shape, &mut budget)?;
            }
        }
        for node in &graph.node {
            network.step(node, &mut budget)?;
        }
        network.output = network.only_output(graph)?;
        Ok(network)
    }

    /// Keeps a name that nothing else has.
    fn name(&mut self, name: &'m str) -> Result<(), DeriveError> {
        if !name.is_empty() && self.names.insert(name) {
            return Ok(());
        }
        refused(format!("two of its values have the name {name:?}"))
    }

    fn stored(&mut self, tensor: &'m Tensor) -> Result<(), DeriveError> {
        let name = tensor.name.as_deref().unwrap_or_default();
        if tensor.data_location == Some(data_location::EXTERNAL) {
            return refused(format!(
                "its weights ({name}) are in another file: export it into one (external_data=False)"
            ));
        }
        self.name(name)?;
        let Some(shape) = dims(tensor).filter(|shape| size(shape).is_some()) else {
            return refused(format!(
                "the stored tensor {name} has the shape {:?}",
                tensor.dims
            ));
        };
        if let Some(constant) = Constant::of_tensor(tensor) {
            self.known.constants.insert(name, constant);
        }
        self.known.shapes.insert(name, shape);
        Ok(())
    }

    /// Keeps the shape of what is computed, within bounds.
    fn shaped(
        &mut self,
        name: &'m str,
        shape: Vec<usize>,
        budget: &mut usize,
    ) -> Result<(), DeriveError> {
        let Some(rest) = size(&shape).and_then(|size| budget.checked_sub(size)) else {
            return Err(DeriveError::TooLarge {
                what: "numbers in all values together",
                most: MOST_ELEMENTS,
            });
        };
        *budget = rest;
        self.known.shapes.insert(name, shape);
        Ok(())
    }

    fn step(&mut self, node: &'m Node, budget: &mut usize) -> Result<(), DeriveError> {
        let nested = |kind: i32| SUBGRAPHS.contains(&kind);
        if node
            .attribute
            .iter()
            .any(|one| one.r#type.is_some_and(nested))
        {
            return refused(format!(
                "it has control flow ({}): export it for one picture of a static shape",
                operator::name(node)
            ));
        }
        if node.input.len().max(node.output.len()) > MOST_PORTS {
            return Err(DeriveError::TooLarge {
                what: "inputs or outputs of a node",
                most: MOST_PORTS,
            });
        }
        for input in node.input.iter().filter(|input| !input.is_empty()) {
            if !self.names.contains(input.as_str()) {
                return refused(format!(
                    "{input}, which {} takes, is not there before it",
                    operator::name(node)
                ));
            }
        }
        for output in node.output.iter().filter(|output| !output.is_empty()) {
            self.name(output)?;
        }
        let first = node.output.first().map_or("", String::as_str);
        let operator = match operator::read(node, &self.known) {
            Ok(read) => {
                if let Some(constant) = read.constant {
                    self.known.constants.insert(first, constant);
                }
                self.shaped(first, read.shape, budget)?;
                Ok(read.operator)
            }
            Err(reason) => Err(reason),
        };
        self.nodes.push(Step { node, operator });
        Ok(())
    }

    /// The only output, which must be one number.
    fn only_output(&self, graph: &'m Graph) -> Result<&'m str, DeriveError> {
        let [port] = &graph.output[..] else {
            return refused(format!(
                "it has {} outputs; one that has one number is needed",
                graph.output.len()
            ));
        };
        let (name, shape) = declared(port)?;
        if !self.names.contains(name) {
            return refused(format!("nothing gives its output {name}"));
        }
        if elements(&shape) != Some(1) {
            return refused(format!(
                "its output {name} has the shape {shape:?}; one number is needed"
            ));
        }
        match self.shape(name) {
            Some(found) if found != shape => refused(format!(
                "its output {name} is declared as {shape:?}, but has the shape {found:?}"
            )),
            _ => Ok(name),
        }
    }

    /// A value's shape, where it is known.
    pub(crate) fn shape(&self, name: &str) -> Option<&[usize]> {
        self.known.shapes.get(name).map(Vec::as_slice)
    }

    /// Every value's name.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().copied()
    }
}
