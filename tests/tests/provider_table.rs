//! What execution providers take of the deform graph, by a table of what ONNX Runtime's code for each asks of a node.
//!
//! The table was written from ONNX Runtime's sources as they are beside the QNN plugin 2.0 (January 2026): `onnxruntime/core/providers/nnapi/nnapi_builtin/builders/`,
//! `xnnpack/` and `qnn/builder/`. Constants are folded before a provider sees the graph (level 1), so a node of constants alone is none here.

use onnx_schema::{Graph, Model, Node, ValueInfo, data_type};
use prost::Message;
use spmm3::networks::{Dialect, GraphParts};
use std::collections::HashMap;
use synthetic_person::Puppet;

const PARTS: [GraphParts; 3] = [GraphParts::Whole, GraphParts::Skinned, GraphParts::Networks];

/// A value: its shape, and whether it is a constant.
#[derive(Debug, Clone)]
struct Value {
    dims: Vec<usize>,
    is_constant: bool,
    /// The elements of a constant of 64-bit integers.
    integers: Vec<i64>,
    kind: i32,
}

/// A node that a provider sees, with its inputs.
#[derive(Debug)]
struct Seen {
    name: String,
    operator: String,
    inputs: Vec<Value>,
    axes_are_an_attribute: bool,
}

/// Everything that is left once constants are folded, in order.
fn seen(model: &[u8]) -> Vec<Seen> {
    let model = Model::decode(model).expect("ONNX");
    let versions = model.opset_import.iter().map(|set| set.version);
    assert_eq!(
        versions.collect::<Vec<_>>(),
        [Some(17)],
        "what the table is of"
    );
    let graph = model.graph.expect("a graph");
    let mut values = stored(&graph);
    let mut nodes = Vec::new();
    for node in &graph.node {
        let inputs: Vec<Value> = (node.input.iter())
            .map(|name| values.get(name).expect("a value made before").clone())
            .collect();
        let is_constant = inputs.iter().all(|input| input.is_constant);
        let value = Value {
            dims: shape_of(node, &inputs),
            is_constant,
            integers: Vec::new(),
            kind: data_type::FLOAT,
        };
        values.insert(node.output[0].clone(), value);
        if !is_constant {
            let mut attributes = node.attribute.iter();
            nodes.push(Seen {
                name: node.name.clone().expect("a name"),
                operator: node.op_type.clone().expect("an operator"),
                inputs,
                axes_are_an_attribute: attributes.any(|it| it.name.as_deref() == Some("axes")),
            });
        }
    }
    for port in &graph.output {
        let made = &values[port.name.as_ref().expect("a name")];
        assert_eq!(made.dims, declared(port), "as the nodes make it");
    }
    nodes
}

fn stored(graph: &Graph) -> HashMap<String, Value> {
    let size = |size: i64| usize::try_from(size).expect("a size");
    let constants = graph.initializer.iter().map(|tensor| {
        let raw = tensor.raw_data.as_deref().expect("raw");
        let kind = tensor.data_type.expect("a type");
        let integers = match kind {
            data_type::INT64 => raw
                .as_chunks()
                .0
                .iter()
                .map(|b| i64::from_le_bytes(*b))
                .collect(),
            _ => Vec::new(),
        };
        let value = Value {
            dims: tensor.dims.iter().map(|dim| size(*dim)).collect(),
            is_constant: true,
            integers,
            kind,
        };
        (tensor.name.clone().expect("a name"), value)
    });
    let inputs = graph.input.iter().map(|port| {
        let value = Value {
            dims: declared(port),
            is_constant: false,
            integers: Vec::new(),
            kind: data_type::FLOAT,
        };
        (port.name.clone().expect("a name"), value)
    });
    constants.chain(inputs).collect()
}

/// The shape that a graph declares for an input or output.
fn declared(port: &ValueInfo) -> Vec<usize> {
    let tensor = port.r#type.as_ref().and_then(|it| it.tensor_type.as_ref());
    let shape = tensor.and_then(|tensor| tensor.shape.as_ref());
    let sides = shape.expect("a shape").dim.iter();
    let side = |side: i64| usize::try_from(side).expect("a size");
    sides
        .map(|it| side(it.dim_value.expect("static")))
        .collect()
}

/// The shape of a node's output, by ONNX's definition of its operator.
fn shape_of(node: &Node, inputs: &[Value]) -> Vec<usize> {
    let of = |at: usize| &inputs[at].dims;
    match node.op_type.as_deref().expect("an operator") {
        "Gemm" | "MatMul" => {
            let (a, b) = (of(0), of(1));
            let mut out = a[..a.len() - 1].to_vec();
            out.push(b[b.len() - 1]);
            out
        }
        "Mul" | "Add" => broadcast(of(0), of(1)),
        "Sigmoid" | "Cast" => of(0).clone(),
        "Reshape" => {
            let sizes = inputs[1].integers.iter();
            sizes
                .map(|size| usize::try_from(*size).expect("no size is inferred"))
                .collect()
        }
        "Slice" => {
            let bound = |at: usize| usize::try_from(inputs[at].integers[0]).expect("a bound");
            let mut out = of(0).clone();
            out[bound(3)] = bound(2) - bound(1);
            out
        }
        "Gather" => [&of(1)[..], &of(0)[1..]].concat(),
        "Transpose" => of(0).iter().rev().copied().collect(),
        "ReduceSum" | "ReduceMean" => {
            let mut out = of(0).clone();
            out.remove(1);
            out
        }
        other => panic!("the graph has {other} now: say what its shape is, and who takes it"),
    }
}

fn broadcast(a: &[usize], b: &[usize]) -> Vec<usize> {
    let rank = a.len().max(b.len());
    let at = |dims: &[usize], axis: usize| match (axis + dims.len()).checked_sub(rank) {
        Some(axis) => dims[axis],
        None => 1,
    };
    (0..rank).map(|axis| at(a, axis).max(at(b, axis))).collect()
}

/// How NNAPI's builder takes a node: by so many of its operations, which Android has from this API level on. Or why it does not.
fn nnapi(node: &Seen) -> Result<(usize, u32), &'static str> {
    let inputs = &node.inputs;
    // base_op_builder.cc: the first input is of floats; *_op_builder.cc: of rank 4 at most.
    if inputs[0].kind != data_type::FLOAT {
        return Err("its first input is not of floats");
    }
    if inputs.iter().any(|input| input.dims.len() > 4) {
        return Err("more than four dimensions");
    }
    let ranks: Vec<usize> = inputs.iter().map(|input| input.dims.len()).collect();
    match node.operator.as_str() {
        // gemm_op_builder.cc: FULLY_CONNECTED.
        "Gemm" if ranks[..2] == [2, 2] && inputs[1].is_constant && ranks[2] == 1 => Ok((1, 27)),
        "MatMul" if ranks == [2, 2] && inputs[1].is_constant => Ok((1, 27)),
        // op_builder_helpers.cc, BuildBatchMatMul: TRANSPOSE, two SPLITs, for each member of the batch RESHAPE, FULLY_CONNECTED, RESHAPE and the RESHAPE of its
        // weights, CONCATENATION.
        "MatMul" if ranks[0] == ranks[1] && ranks[0] >= 3 => {
            let batch: usize = inputs[0].dims[..ranks[0] - 2].iter().product();
            Ok((4 * batch + 4, 29))
        }
        "Sigmoid" | "Mul" | "Add" => Ok((1, 27)),
        "Reshape" if inputs[1].is_constant && !inputs[1].integers.contains(&0) => Ok((1, 27)),
        "Slice" if inputs[1..].iter().all(|bound| bound.is_constant) => Ok((1, 28)),
        "Gather" if inputs[1].kind == data_type::INT32 => Ok((1, 29)),
        "Transpose" => Ok((1, 28)),
        "ReduceMean" if node.axes_are_an_attribute => Ok((1, 28)),
        // op_builder_factory.cc has no other.
        _ => Err("it has no builder for it"),
    }
}

/// Whether XNNPACK has a kernel: gemm.cc, matmul.cc. All else of ours is ONNX Runtime's own.
fn xnnpack(node: &Seen) -> bool {
    let inputs = &node.inputs;
    match node.operator.as_str() {
        "Gemm" => inputs[1..].iter().all(|input| input.is_constant),
        "MatMul" => inputs[1].is_constant && inputs[1].dims.len() <= 2,
        _ => false,
    }
}

/// Whether QNN has a builder: op_builder_factory.cc. Its own validator has the last word, which `tests/qnn` asks.
fn qnn(node: &Seen) -> bool {
    let inputs = &node.inputs;
    match node.operator.as_str() {
        "Gemm" | "MatMul" | "Sigmoid" | "Mul" | "Add" | "Reshape" | "Transpose" | "ReduceMean" => {
            true
        }
        "Gather" | "ReduceSum" | "Slice" => inputs[1..].iter().all(|input| input.is_constant),
        _ => false,
    }
}

fn graph(parts: GraphParts, dialect: Dialect) -> Vec<Seen> {
    let puppet = Puppet::small().avatar();
    let onnx = puppet
        .graph(parts, dialect)
        .expect("the networks come back");
    seen(&onnx)
}

#[test]
fn nnapi_takes_all_of_the_graph_in_its_dialect_one_operation_a_node() {
    for parts in PARTS {
        let nodes = graph(parts, Dialect::Nnapi);
        for node in &nodes {
            match nnapi(node) {
                Ok((operations, level)) => {
                    assert_eq!(operations, 1, "{parts:?}: {node:?}");
                    assert!(level <= 29, "Android 10: {node:?}");
                }
                Err(why) => panic!("{parts:?}: {why}: {node:?}"),
            }
        }
        println!("{parts:?}: {} nodes, all NNAPI's", nodes.len());
    }
}

#[test]
fn the_packages_dialect_is_refused_by_one_node_and_takes_thousands_of_operations() {
    let nodes = graph(GraphParts::Whole, Dialect::Package);
    let refused: Vec<_> = nodes.iter().filter(|node| nnapi(node).is_err()).collect();
    let names: Vec<&str> = refused.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["residuals.ReduceSum"]);
    let unrolled = nodes.iter().filter_map(|node| nnapi(node).ok());
    let most = unrolled.map(|(operations, _)| operations).max();
    let controllers = Puppet::small().controllers.vertices().len();
    assert_eq!(most, Some(4 * controllers + 4), "a batch taken apart");
}

#[test]
fn xnnpack_takes_the_products_and_qnn_everything_in_either_dialect() {
    for (parts, products) in PARTS.into_iter().zip([6, 6, 5]) {
        for dialect in [Dialect::Package, Dialect::Nnapi] {
            let nodes = graph(parts, dialect);
            let taken = nodes.iter().filter(|node| xnnpack(node));
            assert_eq!(taken.count(), products, "{parts:?} {dialect:?}");
            let refused: Vec<_> = nodes.iter().filter(|node| !qnn(node)).collect();
            assert!(refused.is_empty(), "{parts:?} {dialect:?}: {refused:?}");
        }
    }
}

/// As ONNX Runtime says at level 1, of a graph of the same operators: 41, 30 and 16 nodes.
#[test]
fn as_many_nodes_are_left_as_onnx_runtime_leaves() {
    for (parts, left) in PARTS.into_iter().zip([41, 30, 16]) {
        let nodes = graph(parts, Dialect::Package);
        assert_eq!(nodes.len(), left, "{parts:?}");
    }
}
