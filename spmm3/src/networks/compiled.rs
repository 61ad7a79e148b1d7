//! A deform graph compiled for one chip's NPU: an ONNX model whose only node, ONNX Runtime's `EPContext`, holds the
//! compiled form. It is no substitute for the plain graph: only that chip's runtime can read it, and no other program can check
//! what it computes.

use super::GraphSignature;
use super::inspect::find_graph;
use super::inspect::read_port;
use super::wire::Checked;
use super::wire::refuse;
use super::wire::{Fields, Value};

/// The deform graph compiled for one chip.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompiledGraph {
    /// The chip, by the name that `npu-runtime` knows it by: lower-case letters, digits and hyphens.
    pub target: String,
    /// The version of ONNX Runtime that it was compiled with.
    pub onnx_runtime: String,
    /// The model.
    pub onnx: Vec<u8>,
}

/// Attributes of `EPContext` that QNN writes. What may name a file (`ep_cache_context` without embedding) must be
/// embedded.
const ATTRIBUTES: [&[u8]; 10] = [
    b"main_context",
    b"ep_cache_context",
    b"embed_mode",
    b"ep_sdk_version",
    b"source",
    b"partition_name",
    b"max_size",
    b"is_multi_soc_ep_context",
    b"hardware_architecture",
    b"notes",
];

/// Refuses `model` unless it is one embedded `EPContext` node from QNN between the inputs and outputs of `expected`; gives
/// the version of QNN that compiled it.
pub(crate) fn check_compiled(model: &[u8], expected: &GraphSignature) -> Checked<String> {
    for field in Fields(model) {
        match field? {
            // Versions, names, a text, the graph, operator sets, notes.
            (1..=8 | 14, _) => {}
            (number, _) => return refuse(format!("field {number} of the model")),
        }
    }
    let mut found = GraphSignature::default();
    let mut node = None;
    for field in Fields(find_graph(model)?) {
        match field? {
            (1, Value::Bytes(bytes)) if node.is_none() => node = Some(bytes),
            (1, _) => return refuse("more than one node in a compiled graph"),
            (2 | 10, _) => {}
            (11, Value::Bytes(port)) if found.inputs.len() < 8 => {
                found.inputs.push(read_port(port)?);
            }
            (12, Value::Bytes(port)) if found.outputs.len() < 8 => {
                found.outputs.push(read_port(port)?);
            }
            (number, _) => return refuse(format!("a compiled graph with field {number}")),
        }
    }
    if (&found.inputs, &found.outputs) != (&expected.inputs, &expected.outputs) {
        return refuse(format!(
            "it has inputs {:?} and outputs {:?}, but the plain graph has {:?} and {:?}",
            found.inputs, found.outputs, expected.inputs, expected.outputs
        ));
    }
    check_node(node.unwrap_or_default(), expected)
}

fn check_node(node: &[u8], expected: &GraphSignature) -> Checked<String> {
    let (mut operator, mut domain) = (&b""[..], &b""[..]);
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let mut context = Context::default();
    for field in Fields(node) {
        match field? {
            (1, Value::Bytes(name)) if inputs.len() < 8 => inputs.push(name),
            (2, Value::Bytes(name)) if outputs.len() < 8 => outputs.push(name),
            (3 | 6 | 8, _) => {}
            (4, Value::Bytes(text)) => operator = text,
            (5, Value::Bytes(attribute)) => context.read(attribute)?,
            (7, Value::Bytes(text)) => domain = text,
            (number, _) => return refuse(format!("a node with field {number}")),
        }
    }
    if (operator, domain) != (b"EPContext", b"com.microsoft") {
        return refuse("its node is not ONNX Runtime's EPContext");
    }
    let named = |ports: &[(String, Vec<usize>)], names: &[&[u8]]| {
        ports
            .iter()
            .map(|(name, _)| name.as_bytes())
            .eq(names.iter().copied())
    };
    if !named(&expected.inputs, &inputs) || !named(&expected.outputs, &outputs) {
        return refuse("its node is not between the graph's inputs and outputs");
    }
    context.finish()
}

/// The relevant attributes of a node.
#[derive(Default)]
struct Context<'a> {
    embedded: bool,
    main: bool,
    bytes: usize,
    source: &'a [u8],
    version: &'a [u8],
}

impl<'a> Context<'a> {
    fn read(&mut self, attribute: &'a [u8]) -> Checked<()> {
        let (mut name, mut number, mut text) = (&b""[..], 0, &b""[..]);
        for field in Fields(attribute) {
            match field? {
                (1, Value::Bytes(bytes)) => name = bytes,
                (3, Value::Number(value)) => number = value,
                (4, Value::Bytes(bytes)) => text = bytes,
                (13 | 20, _) => {}
                (field, _) => return refuse(format!("an attribute with field {field}")),
            }
        }
        match name {
            b"embed_mode" => self.embedded = number == 1,
            b"main_context" => self.main = number == 1,
            b"ep_cache_context" => self.bytes = text.len(),
            b"source" => self.source = text,
            b"ep_sdk_version" => self.version = text,
            _ if ATTRIBUTES.contains(&name) => {}
            _ => {
                let name = String::from_utf8_lossy(name.get(..64).unwrap_or(name));
                return refuse(format!("an attribute {name:?}"));
            }
        }
        Ok(())
    }

    fn finish(self) -> Checked<String> {
        if !self.embedded || !self.main || self.bytes == 0 {
            return refuse("its compiled form is not embedded in it");
        }
        if !matches!(self.source, b"QNN" | b"QNNExecutionProvider") {
            return refuse("it was not compiled by QNN");
        }
        let version = std::str::from_utf8(self.version).unwrap_or_default();
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        if version.is_empty() || version.len() > 64 || !version.chars().all(plain) {
            return refuse("it does not say which version of QNN compiled it");
        }
        Ok(version.to_owned())
    }
}
