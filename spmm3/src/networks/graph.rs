//! The deform graph: F_mesh -> LBS and F_attr in one static ONNX graph, or those parts of it that one unit computes.
//!
//! Shapes are static, rank is at most 4, tensors are planar and inputs and outputs FP32: the form that both the CPU and
//! the Hexagon NPU run whole. Stored FP16 and 8-bit weights are widened by constant nodes, which ONNX Runtime folds when
//! it loads the graph, so that they cost nothing per frame.

use super::parts::{Dialect, GraphParts, GraphSizes, Port, input, output};
use super::writer::{Sink, Writer, dim};
use super::{AttributeNetwork, MeshNetwork};
use crate::{ATTRIBUTES, Controllers, JOINTS, NEIGHBOURS, PersonError, Template};
use onnx_schema::{Attribute, Graph, Model, OperatorSet, ValueInfo};
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
        self.to_onnx_in(parts, Dialect::Package)
    }

    /// The same by the operators of a dialect.
    ///
    /// # Errors
    /// As [`Self::to_onnx`].
    pub fn to_onnx_in(&self, parts: GraphParts, dialect: Dialect) -> Result<Vec<u8>, PersonError> {
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
        self.write(parts, dialect, &mut graph);
        let model = Model {
            graph: Some(graph),
            ..head()
        };
        Ok(model.encode_to_vec())
    }

    /// Hands every node and every stored tensor to `sink`, in the file's order. The networks fit each other.
    pub(super) fn write(&self, parts: GraphParts, dialect: Dialect, sink: &mut dyn Sink) {
        let mut writer = Writer { sink, dialect };
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
        let canonical = mesh.rest_shape(self.template);
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
        let shape = match w.dialect {
            Dialect::Package => [controllers, 1, hidden],
            Dialect::Nnapi => [controllers, hidden, 1],
        };
        let shape = w.int64("attr.rows.shape", &shape);
        let rows = w.op("Reshape", "attr.rows", &[&units, &shape], &[]);
        let second = w.half(
            "attr.second.weights",
            &[controllers, hidden, bases],
            &network.second,
        );
        if w.dialect == Dialect::Nnapi {
            let second = w.times("attr.second.weights", &second, hidden);
            let products = w.op("Mul", "attr.second.products", &[&rows, &second], &[]);
            let potentials = w.mean("attr.second.product.out", &products);
            let bias = w.float(
                "attr.second.bias",
                &[controllers, bases],
                &network.second_bias,
            );
            return w.op_named("Add", out, &[&potentials, &bias], &[]);
        }
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
        let mut full = w.op("Mul", "attr.bases", &[&values, &scales], &[]);
        if w.dialect == Dialect::Nnapi {
            full = w.times("attr.bases", &full, bases);
        }
        let weighed = w.op("Mul", "attr.weighed", &[&full, &force], &[]);
        if w.dialect == Dialect::Nnapi {
            w.mean(output::RESIDUALS, &weighed);
            return;
        }
        let axes = w.int64("attr.axes", &[1]);
        w.op_named(
            "ReduceSum",
            output::RESIDUALS,
            &[&weighed, &axes],
            &[Attribute::int("keepdims", 0)],
        );
    }
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
