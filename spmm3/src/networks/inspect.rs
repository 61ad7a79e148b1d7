//! Reads the signature and contents of an untrusted deform graph, without copying it.
//!
//! ONNX can name files to load, loops to run and custom libraries' operators. A package is untrusted, so the
//! graph may only be what a static feed-forward network needs: known operators, numbers inside the file, all finite.

use super::wire::{Checked, Fields, GraphRefused, Value, refuse, varint};
use half::f16;
use onnx_schema::{Tensor, ValueInfo, data_type};
use prost::Message;

/// Operators a deform graph may use: static, without control flow, each known to the CPU and the NPU provider.
const OPERATORS: [&str; 11] = [
    "Add",
    "Cast",
    "Gather",
    "Gemm",
    "MatMul",
    "Mul",
    "ReduceSum",
    "Reshape",
    "Sigmoid",
    "Slice",
    "Transpose",
];

/// Most nodes, and most stored tensors, of a graph. Ours has about 60.
const MAX_PARTS: usize = 4096;
/// Most bytes of one description of an input, an output or a node.
const MAX_DESCRIPTION: usize = 4096;

/// A graph's declared inputs and outputs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct GraphSignature {
    /// Inputs in order: name and static shape of a float tensor.
    pub inputs: Vec<(String, Vec<usize>)>,
    /// Outputs in order.
    pub outputs: Vec<(String, Vec<usize>)>,
    /// B, if the graph stores its deformation bases as [`super::DeformGraph`] does.
    pub bases: Option<usize>,
}

impl GraphSignature {
    /// Reads `model`, the bytes of an ONNX file, and checks every node and stored tensor in it.
    ///
    /// # Errors
    /// If it is not an ONNX graph, or holds what no deform graph needs.
    pub fn read(model: &[u8]) -> Checked<Self> {
        let graph = find_graph(model)?;
        let mut signature = Self::default();
        let (mut nodes, mut tensors) = (0, 0);
        for field in Fields(graph) {
            match field? {
                (1, Value::Bytes(node)) => {
                    nodes += 1;
                    check_node(node)?;
                }
                (5, Value::Bytes(tensor)) => {
                    tensors += 1;
                    let stored = check_tensor(tensor)?;
                    if let ("attr.bases.values", [_, bases, _]) = (stored.name, &stored.dims[..]) {
                        signature.bases = Some(*bases);
                    }
                }
                (11, Value::Bytes(port)) => signature.inputs.push(read_port(port)?),
                (12, Value::Bytes(port)) => signature.outputs.push(read_port(port)?),
                (2 | 10, _) => {}
                (number, _) => return refuse(format!("the graph holds field {number}")),
            }
            if nodes.max(tensors) > MAX_PARTS
                || signature.inputs.len().max(signature.outputs.len()) > 8
            {
                return refuse("more nodes, tensors, inputs or outputs than a deform graph has");
            }
        }
        Ok(signature)
    }
}

/// The one graph of an ONNX file.
pub(super) fn find_graph(model: &[u8]) -> Checked<&[u8]> {
    let mut graph = None;
    for field in Fields(model) {
        match field? {
            (7, Value::Bytes(bytes)) if graph.is_none() => graph = Some(bytes),
            (7 | 20 | 25, _) => return refuse("more than one static graph"),
            _ => {}
        }
    }
    graph.map_or_else(|| refuse("no graph in it"), Ok)
}

/// A tensor stored in a graph, in place.
pub(super) struct Stored<'a> {
    name: &'a str,
    kind: i32,
    dims: Vec<usize>,
    raw: &'a [u8],
}

impl<'a> Stored<'a> {
    /// The stored tensor `name` of `model`.
    pub(super) fn find(model: &'a [u8], name: &str) -> Checked<Self> {
        for field in Fields(find_graph(model)?) {
            if let (5, Value::Bytes(tensor)) = field? {
                let stored = check_tensor(tensor)?;
                if stored.name == name {
                    return Ok(stored);
                }
            }
        }
        refuse(format!("no stored tensor {name}"))
    }

    /// The tensor's sizes, which must be this many and none zero: no product of them exceeds the file's size then.
    pub(super) fn shape<const RANK: usize>(&self) -> Checked<[usize; RANK]> {
        match self.dims[..].try_into() {
            Ok(shape) if !self.dims.contains(&0) => Ok(shape),
            _ => refuse(format!(
                "stored tensor {:?} has shape {:?}",
                self.name, self.dims
            )),
        }
    }

    pub(super) fn name(&self) -> &'a str {
        self.name
    }

    /// Its numbers, little-endian.
    pub(super) fn raw(&self) -> &'a [u8] {
        self.raw
    }

    /// How many numbers it holds.
    pub(super) fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Whether name, element type and shape are those of `other`.
    pub(super) fn has_head_of(&self, other: &Tensor) -> bool {
        let dims = self.dims.iter().map(|d| i64::try_from(*d).unwrap_or(-1));
        other.name.as_deref() == Some(self.name)
            && other.data_type == Some(self.kind)
            && dims.eq(other.dims.iter().copied())
    }

    pub(super) fn floats(&self) -> Checked<Vec<f32>> {
        let bytes = self.of_kind(data_type::FLOAT)?.as_chunks().0;
        Ok(bytes.iter().map(|b| f32::from_le_bytes(*b)).collect())
    }

    pub(super) fn halves(&self) -> Checked<Vec<f16>> {
        let bytes = self.of_kind(data_type::FLOAT16)?.as_chunks().0;
        Ok(bytes.iter().map(|b| f16::from_le_bytes(*b)).collect())
    }

    pub(super) fn bytes(&self) -> Checked<Vec<i8>> {
        Ok(bytemuck::cast_slice(self.of_kind(data_type::INT8)?).to_vec())
    }

    fn of_kind(&self, kind: i32) -> Checked<&'a [u8]> {
        if self.kind == kind {
            Ok(self.raw)
        } else {
            refuse(format!(
                "stored tensor {:?} has element type {}, not {kind}",
                self.name, self.kind
            ))
        }
    }
}

/// A float tensor's name and static shape.
pub(super) fn read_port(bytes: &[u8]) -> Checked<(String, Vec<usize>)> {
    if bytes.len() > MAX_DESCRIPTION {
        return refuse("an input or output described at too great length");
    }
    let info = ValueInfo::decode(bytes).map_err(|e| GraphRefused(e.to_string()))?;
    let name = info.name.unwrap_or_default();
    let tensor = info.r#type.and_then(|t| t.tensor_type);
    let Some(tensor) = tensor.filter(|t| t.elem_type == Some(data_type::FLOAT)) else {
        return refuse(format!("{name:?} is not a float tensor"));
    };
    let shape = tensor.shape.map(|s| s.dim).unwrap_or_default();
    let sizes = shape
        .iter()
        .map(|d| d.dim_value.and_then(|v| usize::try_from(v).ok()))
        .collect::<Option<Vec<usize>>>();
    match sizes {
        Some(sizes) => Ok((name, sizes)),
        None => refuse(format!("{name:?} has no static shape")),
    }
}

/// Only known operators of ONNX itself, and no sub-graphs or tensors in attributes.
fn check_node(bytes: &[u8]) -> Checked<()> {
    if bytes.len() > MAX_DESCRIPTION {
        return refuse("a node described at too great length");
    }
    let mut operator = None;
    for field in Fields(bytes) {
        match field? {
            (4, Value::Bytes(op)) => operator = Some(op),
            (5, Value::Bytes(attribute)) => {
                for part in Fields(attribute) {
                    if let (5 | 6 | 9..=12 | 14.., Value::Bytes(_)) = part? {
                        return refuse("a node with a graph or tensor in an attribute");
                    }
                }
            }
            (7, Value::Bytes(domain)) if !domain.is_empty() => {
                return refuse("an operator of a foreign domain");
            }
            _ => {}
        }
    }
    let operator = String::from_utf8_lossy(operator.unwrap_or_default());
    if OPERATORS.contains(&&*operator) {
        Ok(())
    } else {
        refuse(format!(
            "operator {operator:?}, which a deform graph does not use"
        ))
    }
}

/// Numbers stored in the file, as many as the shape says, and finite.
pub(super) fn check_tensor(bytes: &[u8]) -> Checked<Stored<'_>> {
    let (mut name, mut kind, mut raw) = ("", 0, None);
    let mut dims: Vec<usize> = Vec::new();
    for field in Fields(bytes) {
        match field? {
            (1, Value::Number(dim)) if dims.len() < 4 => {
                dims.push(usize::try_from(dim).unwrap_or(usize::MAX));
            }
            (1, Value::Bytes(mut packed)) => {
                while !packed.is_empty() && dims.len() < 4 {
                    dims.push(usize::try_from(varint(&mut packed)?).unwrap_or(usize::MAX));
                }
                if !packed.is_empty() {
                    return refuse("a stored tensor of rank above 4");
                }
            }
            (2, Value::Number(number)) => kind = number,
            (8, Value::Bytes(text)) => name = std::str::from_utf8(text).unwrap_or("?"),
            (9, Value::Bytes(data)) if raw.is_none() => raw = Some(data),
            (12, _) => {}
            (number, _) => {
                return refuse(format!(
                    "stored tensor {name:?} has field {number}: its numbers must be raw data in this file"
                ));
            }
        }
    }
    let raw = raw.unwrap_or_default();
    let kind = i32::try_from(kind).unwrap_or(0);
    let width = match kind {
        data_type::FLOAT | data_type::INT32 => 4,
        data_type::FLOAT16 => 2,
        data_type::INT8 => 1,
        data_type::INT64 => 8,
        _ => return refuse(format!("stored tensor {name:?} has element type {kind}")),
    };
    let needed = dims
        .iter()
        .try_fold(width, |size: usize, dim| size.checked_mul(*dim));
    if needed != Some(raw.len()) {
        return refuse(format!(
            "stored tensor {name:?} has {} bytes for shape {dims:?}",
            raw.len()
        ));
    }
    let finite = match kind {
        data_type::FLOAT => raw
            .as_chunks()
            .0
            .iter()
            .all(|b| f32::from_le_bytes(*b).is_finite()),
        data_type::FLOAT16 => raw
            .as_chunks()
            .0
            .iter()
            .all(|b| f16::from_le_bytes(*b).is_finite()),
        _ => true,
    };
    if finite {
        Ok(Stored {
            name,
            kind,
            dims,
            raw,
        })
    } else {
        refuse(format!(
            "stored tensor {name:?} holds a number that is not finite"
        ))
    }
}
