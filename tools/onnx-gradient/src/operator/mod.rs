//! What a node does: its operator's settings, checked once, the shape that it gives, and its derivative.

mod arithmetic;
mod arrange;
mod reduce;
mod window;

use crate::constant::Constant;
use crate::emitter::Emitter;
use crate::shape::i64_of;
use onnx_schema::{Attribute, Node};
use std::collections::HashMap;

/// Operators that can be derived. `Dropout` is that of inference, the exponent of `Pow` 2 or 0.5, and `Conv` and `MaxPool` are those of
/// pictures, without groups and dilations.
pub const OPERATORS: [&str; 19] = [
    "Add",
    "Concat",
    "Constant",
    "Conv",
    "Div",
    "Dropout",
    "Flatten",
    "Identity",
    "MaxPool",
    "Mul",
    "Pow",
    "ReduceMean",
    "ReduceSum",
    "Relu",
    "Reshape",
    "Sqrt",
    "Squeeze",
    "Sub",
    "Unsqueeze",
];

/// What is known of values before they are computed.
#[derive(Debug, Default)]
pub(crate) struct Known<'m> {
    pub(crate) shapes: HashMap<&'m str, Vec<usize>>,
    pub(crate) constants: HashMap<&'m str, Constant>,
}

/// An operator with its settings.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Operator {
    /// The same numbers in the same shape.
    Same,
    /// The same numbers in another shape.
    Arranged,
    /// Joined along an axis.
    Joined { axis: usize },
    /// max(x, 0).
    Relu,
    /// The square root.
    Root,
    /// The square.
    Square,
    /// Of two values, one of them repeated to the shape of the other.
    Arithmetic(arithmetic::Kind),
    /// The sum over axes, or their mean.
    Reduced { axes: Vec<usize>, mean: bool },
    /// A convolution.
    Conv(window::Window),
    /// The largest within windows.
    MaxPool(window::Pool),
    /// Depends on nothing.
    Constant,
}

/// A node that was understood.
#[derive(Debug)]
pub(crate) struct Read {
    pub(crate) operator: Operator,
    /// Of its first output.
    pub(crate) shape: Vec<usize>,
    /// What it gives, where that is a small constant.
    pub(crate) constant: Option<Constant>,
}

impl Read {
    fn new(operator: Operator, shape: Vec<usize>) -> Self {
        Self {
            operator,
            shape,
            constant: None,
        }
    }
}

/// ONNX's name of a node's operator.
pub(crate) fn name(node: &Node) -> &str {
    node.op_type.as_deref().unwrap_or_default()
}

/// By what a node is found in the file: its name, else that of what it gives.
pub(crate) fn label(node: &Node) -> &str {
    let own = node.name.as_deref().filter(|name| !name.is_empty());
    own.or(node.output.first().map(String::as_str))
        .unwrap_or_default()
}

/// Understands a node of which `known` is known; else says why not.
pub(crate) fn read(node: &Node, known: &Known<'_>) -> Result<Read, String> {
    if !matches!(node.domain.as_deref(), None | Some("" | "ai.onnx")) {
        return Err("it is none of ONNX's own".to_owned());
    }
    let node = Reader { node, known };
    match name(node.node) {
        "Constant" => {
            let (constant, shape) = Constant::of_node(node.node).ok_or("of an unknown kind")?;
            Ok(Read {
                operator: Operator::Constant,
                shape,
                constant,
            })
        }
        "Identity" => arrange::identity(&node),
        "Dropout" => arrange::dropout(&node),
        "Flatten" => arrange::flatten(&node),
        "Reshape" => arrange::reshape(&node),
        "Squeeze" => arrange::squeeze(&node),
        "Unsqueeze" => arrange::unsqueeze(&node),
        "Concat" => arrange::concat(&node),
        "Add" | "Sub" | "Mul" | "Div" => arithmetic::two(&node),
        "Pow" => arithmetic::power(&node),
        "Sqrt" => Ok(Read::new(Operator::Root, node.shape(0)?.to_vec())),
        "Relu" => Ok(Read::new(Operator::Relu, node.shape(0)?.to_vec())),
        "ReduceSum" => reduce::read(&node, false),
        "ReduceMean" => reduce::read(&node, true),
        "Conv" => window::conv(&node),
        "MaxPool" => window::max_pool(&node),
        _ => Err(format!(
            "its derivative is not known; known are those of {}",
            OPERATORS.join(", ")
        )),
    }
}

/// A node as it is read.
#[derive(Debug, Clone, Copy)]
struct Reader<'a> {
    node: &'a Node,
    known: &'a Known<'a>,
}

impl<'a> Reader<'a> {
    /// The name of an input that is there.
    fn input(&self, at: usize) -> Option<&'a str> {
        let name = self.node.input.get(at)?.as_str();
        Some(name).filter(|name| !name.is_empty())
    }

    fn shape(&self, at: usize) -> Result<&'a [usize], String> {
        let name = self
            .input(at)
            .ok_or_else(|| format!("it has no input {at}"))?;
        let shape = self.known.shapes.get(name);
        shape
            .map(Vec::as_slice)
            .ok_or_else(|| format!("the shape of its input {name} is not known"))
    }

    /// The constant that an input is; nothing where there is no such input.
    fn constant(&self, at: usize) -> Result<Option<&'a Constant>, String> {
        let Some(name) = self.input(at) else {
            return Ok(None);
        };
        match self.known.constants.get(name) {
            Some(constant) => Ok(Some(constant)),
            None => Err(format!("its input {name} is no small constant")),
        }
    }

    /// Integers that an input is; nothing where there is no such input.
    fn ints(&self, at: usize) -> Result<Option<&'a [i64]>, String> {
        match self.constant(at)? {
            None => Ok(None),
            Some(Constant::Ints(ints)) => Ok(Some(ints)),
            Some(_) => Err("an input should be 64-bit integers".to_owned()),
        }
    }

    fn attribute(&self, name: &str) -> Option<&'a Attribute> {
        let mut all = self.node.attribute.iter();
        all.find(|attribute| attribute.name.as_deref() == Some(name))
    }

    /// An integer setting; `default` where it is not made.
    fn int(&self, name: &str, default: i64) -> i64 {
        let setting = self.attribute(name).and_then(|attribute| attribute.i);
        setting.unwrap_or(default)
    }

    /// Axes by an attribute, as old opsets have them, or by input `at`; nothing where neither is there.
    fn axes(&self, at: usize) -> Result<Option<&'a [i64]>, String> {
        match self.attribute("axes") {
            Some(attribute) => Ok(Some(&attribute.ints)),
            None => self.ints(at),
        }
    }
}

/// What a derivative by one input of a node is made from: its own values' names and shapes.
#[derive(Debug)]
pub(crate) struct Shapes<'a> {
    /// The input that is derived by.
    at: usize,
    inputs: Vec<(&'a str, Option<&'a [usize]>)>,
    output: (&'a str, &'a [usize]),
    node: &'a Node,
}

impl<'a> Shapes<'a> {
    /// Of a node's derivative by input `at`.
    pub(crate) fn of(
        node: &'a Node,
        at: usize,
        shape: impl Fn(&str) -> Option<&'a [usize]>,
    ) -> Result<Self, String> {
        let first = node.output.first().map_or("", String::as_str);
        let inputs = node.input.iter();
        Ok(Self {
            at,
            inputs: inputs.map(|name| (name.as_str(), shape(name))).collect(),
            output: (first, shape(first).ok_or("its shape is not known")?),
            node,
        })
    }

    /// Name and shape of an input.
    fn input(&self, at: usize) -> Result<(&'a str, &'a [usize]), String> {
        match self.inputs.get(at) {
            Some((name, Some(shape))) => Ok((name, shape)),
            Some((name, None)) => Err(format!("the shape of its input {name} is not known")),
            None => Err(format!("it has no input {at}")),
        }
    }

    /// Name and shape of the input that is derived by.
    fn own(&self) -> Result<(&'a str, &'a [usize]), String> {
        self.input(self.at)
    }

    /// Refuses a derivative by any but the first input, which the others only tell what to do with.
    fn only_first(&self) -> Result<(), String> {
        match self.at {
            0 => Ok(()),
            at => Err(format!("its input {at} depends on the picture")),
        }
    }
}

impl Operator {
    /// Appends the derivatives by an input, from those by the output. Returns their name.
    pub(crate) fn pull_back(
        &self,
        emitter: &mut Emitter,
        of: &Shapes<'_>,
        by_output: &str,
    ) -> Result<String, String> {
        match self {
            Self::Arithmetic(kind) => return arithmetic::pull_back(*kind, emitter, of, by_output),
            Self::Joined { axis } => return arrange::part(*axis, emitter, of, by_output),
            _ => of.only_first()?,
        }
        let (input, shape) = of.own()?;
        let (output, output_shape) = of.output;
        Ok(match self {
            Self::Same => by_output.to_owned(),
            Self::Arranged => emitter.reshape(by_output, shape),
            Self::Relu => arithmetic::pull_back_relu(emitter, output, by_output),
            Self::Root => arithmetic::pull_back_root(emitter, output, by_output),
            Self::Square => arithmetic::pull_back_square(emitter, input, by_output),
            Self::Reduced { axes, mean } => {
                reduce::pull_back(axes, *mean, emitter, shape, by_output)
            }
            Self::Conv(window) => {
                let (weights, _) = of.input(1)?;
                window.pull_back_conv(emitter, weights, [shape, output_shape], by_output)?
            }
            Self::MaxPool(pool) => {
                let settings = &of.node.attribute;
                pool.pull_back(emitter, (input, settings), [shape, output_shape], by_output)?
            }
            Self::Constant | Self::Arithmetic(_) | Self::Joined { .. } => {
                return Err("it takes nothing that could be derived by".to_owned());
            }
        })
    }
}

/// Sides as a list of numbers of any sign.
fn sides<const N: usize>(values: &[i64]) -> Option<[usize; N]> {
    let sides: Option<Vec<usize>> = values
        .iter()
        .map(|side| usize::try_from(*side).ok())
        .collect();
    sides?.try_into().ok()
}

/// Refuses a setting that is made and not `only`.
fn only(reader: &Reader<'_>, name: &str, only: &[i64]) -> Result<(), String> {
    let Some(attribute) = reader.attribute(name) else {
        return Ok(());
    };
    let made = if attribute.ints.is_empty() {
        attribute.i.as_slice()
    } else {
        &attribute.ints
    };
    if made == only || made.is_empty() {
        return Ok(());
    }
    Err(format!("its {name} are {made:?}, not {only:?}"))
}

/// A tensor's number of axes as ONNX counts.
fn rank(shape: &[usize]) -> i64 {
    i64_of(shape.len())
}
