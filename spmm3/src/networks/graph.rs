//! The deform graph: F_mesh -> LBS and F_attr in one static ONNX graph, or those parts of it that one unit computes.
//!
//! Shapes are static, rank is at most 4, tensors are planar and inputs and outputs FP32: the form that both the CPU and
//! the Hexagon NPU run whole. Stored FP16 and 8-bit weights are widened by constant nodes, which ONNX Runtime folds when
//! it loads the graph, so that they cost nothing per frame.

use super::parts::{GraphParts, GraphSizes, Port, input, output};
use super::{AttributeNetwork, Dense, MeshNetwork};
use crate::{ATTRIBUTES, Controllers, JOINTS, NEIGHBOURS, PersonError, Template};
use onnx_schema::{Attribute, Graph, Model, Node, OperatorSet, Tensor, ValueInfo, data_type};
use prost::Message;

const OPSET: i64 = 17;
const IR_VERSION: i64 = 8;

/// Everything the deform graph is made of.
#[derive(Debug, Clone, Copy)]
pub struct DeformGraph<'a> {
    /// Canonical vertices and skinning weights.
    pub template: &'a Template,
    /// Neighbourhoods and virtual masses.
    pub controllers: &'a Controllers,
    /// F_mesh.
    pub mesh: &'a MeshNetwork,
    /// F_attr.
    pub attributes: &'a AttributeNetwork,
}

impl DeformGraph<'_> {
    /// Writes `parts` of the graph as an ONNX model. A package holds [`GraphParts::Whole`].
    ///
    /// # Errors
    /// If the networks do not fit the template, the controllers or each other.
    pub fn to_onnx(&self, parts: GraphParts) -> Result<Vec<u8>, PersonError> {
        let vertices = self.template.vertices().len();
        let gaussians = self.controllers.neighbours().len();
        self.mesh.check(vertices)?;
        self.attributes
            .check(self.controllers.vertices().len(), gaussians)?;
        let ports = parts.ports(&GraphSizes {
            vertices,
            gaussians,
            controllers: self.controllers.vertices().len(),
            bases: self.attributes.bases.bases(),
        });
        let info = |ports: &[Port]| {
            ports
                .iter()
                .map(|(name, [rows, columns])| ValueInfo::float(name, &[dim(*rows), dim(*columns)]))
                .collect()
        };
        let mut graph = Graph {
            node: Vec::new(),
            name: Some("deform".into()),
            initializer: Vec::new(),
            input: info(&ports.inputs),
            output: info(&ports.outputs),
        };
        self.write(parts, &mut graph);
        let model = Model {
            graph: Some(graph),
            ..head()
        };
        Ok(model.encode_to_vec())
    }

    /// Hands every node and every stored tensor to `sink`, in the file's order. The networks fit each other.
    pub(super) fn write(&self, parts: GraphParts, sink: &mut dyn Sink) {
        let mut writer = Writer { sink };
        let w = &mut writer;
        if parts == GraphParts::Networks {
            self.canonical_vertices(w, output::CANONICAL_VERTICES);
        } else {
            let planes = self.canonical_vertices(w, "mesh.planes.out");
            self.skinning(w, &planes);
        }
        if parts == GraphParts::Whole {
            let potentials = self.potentials(w, "attr.potentials.out");
            self.residuals(w, &potentials);
        } else {
            self.potentials(w, output::POTENTIALS);
        }
    }

    /// `V_template + F_mesh(P)`, as planes named `out`.
    fn canonical_vertices(&self, w: &mut Writer<'_>, out: &str) -> String {
        let vertices = dim(self.template.vertices().len());
        let mesh = self.mesh;
        let hidden = w.dense("mesh.first", input::MOTION, &mesh.first);
        let hidden = w.silu("mesh.first", &hidden);
        let hidden = w.dense("mesh.second", &hidden, &mesh.second);
        let hidden = w.silu("mesh.second", &hidden);
        let code = w.dense("mesh.code", &hidden, &mesh.code);

        let decoder = &mesh.decoder;
        let values = w.int8(
            "mesh.decoder.values",
            &[dim(decoder.rank()), 3 * vertices],
            decoder.values(),
        );
        let scales = w.half("mesh.decoder.scales", &[1, 3 * vertices], decoder.scales());
        let unit = w.float("mesh.decoder.unit", &[1], &[decoder.unit()]);
        let scales = w.op("Mul", "mesh.decoder.scaled", &[&scales, &unit], &[]);
        let fields = w.op("Mul", "mesh.decoder", &[&values, &scales], &[]);
        // The rest shape joins the bias: one addition of constants at bake instead of one per frame.
        let canonical: Vec<f32> = (0..3)
            .flat_map(|axis| self.template.vertices().iter().map(move |v| v[axis]))
            .zip(decoder.mean())
            .map(|(rest, mean)| rest + mean)
            .collect();
        let bias = w.float("mesh.canonical", &[3 * vertices], &canonical);
        let shaped = w.op("Gemm", "mesh.offsets", &[&code, &fields, &bias], &[]);
        let shape = w.int64("mesh.planes.shape", &[3, vertices]);
        w.op_named("Reshape", out, &[&shaped, &shape], &[])
    }

    /// `V_final = LBS(planes)`.
    fn skinning(&self, w: &mut Writer<'_>, planes: &str) {
        let vertices = dim(self.template.vertices().len());
        let weights = self.template.dense_weights_transposed();
        let weights = w.float("skin.weights", &[dim(JOINTS), vertices], &weights);
        let matrices = w.op("MatMul", "skin.matrices", &[input::SKINNING, &weights], &[]);
        let mut sum = w.slice("skin.translation", &matrices, 9, 12);
        for axis in 0..3 {
            let coordinate = w.slice(&format!("skin.rest{axis}"), planes, axis, axis + 1);
            let column = w.slice(
                &format!("skin.column{axis}"),
                &matrices,
                3 * axis,
                3 * axis + 3,
            );
            let term = w.op(
                "Mul",
                &format!("skin.term{axis}"),
                &[&column, &coordinate],
                &[],
            );
            sum = if axis == 2 {
                w.op_named("Add", output::VERTICES, &[&term, &sum], &[])
            } else {
                w.op("Add", &format!("skin.sum{axis}"), &[&term, &sum], &[])
            };
        }
    }

    /// `u_j = SiLU(P A_j + a_j) C_j + c_j` of every controller, named `out`.
    fn potentials(&self, w: &mut Writer<'_>, out: &str) -> String {
        let network = self.attributes;
        let controllers = self.controllers.vertices().len();
        let (hidden, bases) = (dim(network.hidden(controllers)), dim(network.bases.bases()));
        let controllers = dim(controllers);

        let units = w.dense("attr.first", input::MOTION, &network.first);
        let units = w.silu("attr.first", &units);
        let shape = w.int64("attr.rows.shape", &[controllers, 1, hidden]);
        let rows = w.op("Reshape", "attr.rows", &[&units, &shape], &[]);
        let second = w.half(
            "attr.second.weights",
            &[controllers, hidden, bases],
            &network.second,
        );
        let potentials = w.op("MatMul", "attr.second.product", &[&rows, &second], &[]);
        let bias = w.float(
            "attr.second.bias",
            &[controllers, 1, bases],
            &network.second_bias,
        );
        let potentials = w.op("Add", "attr.second", &[&potentials, &bias], &[]);
        let shape = w.int64("attr.potentials.shape", &[controllers, bases]);
        w.op_named("Reshape", out, &[&potentials, &shape], &[])
    }

    /// F_attr's tail: `Delta G_i = sum_b F_i[b] Delta G_i^b`, with F_i mixed from the three controllers' potentials.
    fn residuals(&self, w: &mut Writer<'_>, potentials: &str) {
        let network = self.attributes;
        let gaussians = dim(self.controllers.neighbours().len());
        let bases = dim(network.bases.bases());
        let mut force: Option<String> = None;
        for k in 0..NEIGHBOURS {
            let index: Vec<i32> = self
                .controllers
                .neighbours()
                .iter()
                .map(|n| i32::from(n[k]))
                .collect();
            let mass: Vec<f32> = self.controllers.masses().iter().map(|m| m[k]).collect();
            let index = w.int32(&format!("attr.neighbour{k}"), &[gaussians], &index);
            let mass = w.float(&format!("attr.mass{k}"), &[gaussians, 1], &mass);
            let axis = [Attribute::int("axis", 0)];
            let pulled = w.op(
                "Gather",
                &format!("attr.pull{k}"),
                &[potentials, &index],
                &axis,
            );
            let pulled = w.op("Mul", &format!("attr.share{k}"), &[&pulled, &mass], &[]);
            force = Some(match force {
                None => pulled,
                Some(sum) => w.op("Add", &format!("attr.force{k}"), &[&sum, &pulled], &[]),
            });
        }
        let order = [Attribute::ints("perm", &[1, 0])];
        let force = w.op(
            "Transpose",
            "attr.force",
            &[force.as_deref().unwrap_or_default()],
            &order,
        );

        let quantised = &network.bases;
        let attributes = dim(ATTRIBUTES);
        let values = w.int8(
            "attr.bases.values",
            &[attributes, bases, gaussians],
            quantised.values(),
        );
        let scales = w.half(
            "attr.bases.scales",
            &[attributes, 1, gaussians],
            quantised.scales(),
        );
        let units = w.float("attr.bases.units", &[attributes, 1, 1], quantised.units());
        let scales = w.op("Mul", "attr.bases.scaled", &[&scales, &units], &[]);
        let full = w.op("Mul", "attr.bases", &[&values, &scales], &[]);
        let weighed = w.op("Mul", "attr.weighed", &[&full, &force], &[]);
        let axes = w.int64("attr.axes", &[1]);
        w.op_named(
            "ReduceSum",
            output::RESIDUALS,
            &[&weighed, &axes],
            &[Attribute::int("keepdims", 0)],
        );
    }
}

/// Sizes in this crate stay far below `i64::MAX`.
fn dim(size: usize) -> i64 {
    i64::try_from(size).unwrap_or(i64::MAX)
}

/// The model around the graph.
pub(super) fn head() -> Model {
    Model {
        ir_version: Some(IR_VERSION),
        producer_name: Some("mon3tr".into()),
        graph: None,
        opset_import: vec![OperatorSet {
            domain: Some(String::new()),
            version: Some(OPSET),
        }],
    }
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
struct Writer<'s> {
    sink: &'s mut dyn Sink,
}

impl Writer<'_> {
    fn op(&mut self, op: &str, name: &str, inputs: &[&str], attributes: &[Attribute]) -> String {
        self.op_named(op, &format!("{name}.out"), inputs, attributes)
    }

    fn op_named(
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

    fn dense(&mut self, name: &str, x: &str, layer: &Dense) -> String {
        let (inputs, outputs) = (dim(layer.inputs()), dim(layer.outputs()));
        let weights = self.half(
            &format!("{name}.weights"),
            &[inputs, outputs],
            layer.weights(),
        );
        let bias = self.float(&format!("{name}.bias"), &[outputs], layer.bias());
        self.op("Gemm", name, &[x, &weights, &bias], &[])
    }

    fn silu(&mut self, name: &str, x: &str) -> String {
        let gate = self.op("Sigmoid", &format!("{name}.gate"), &[x], &[]);
        self.op("Mul", &format!("{name}.silu"), &[x, &gate], &[])
    }

    /// Rows `from..to` of a matrix.
    fn slice(&mut self, name: &str, x: &str, from: i64, to: i64) -> String {
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

    fn float(&mut self, name: &str, dims: &[i64], values: &[f32]) -> String {
        self.tensor(
            name,
            data_type::FLOAT,
            dims,
            values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        )
    }

    fn int32(&mut self, name: &str, dims: &[i64], values: &[i32]) -> String {
        self.tensor(
            name,
            data_type::INT32,
            dims,
            values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        )
    }

    /// A one-dimensional list of 64-bit integers: a shape or slice bound.
    fn int64(&mut self, name: &str, values: &[i64]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.tensor(name, data_type::INT64, &[dim(values.len())], raw)
    }

    /// FP16 constants, widened to FP32.
    fn half(&mut self, name: &str, dims: &[i64], values: &[half::f16]) -> String {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let stored = self.tensor(name, data_type::FLOAT16, dims, raw);
        self.widened(name, &stored)
    }

    /// 8-bit constants, widened to FP32.
    fn int8(&mut self, name: &str, dims: &[i64], values: &[i8]) -> String {
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
