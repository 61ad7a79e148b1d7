//! The networks that give a mesh its shape and its controllers their potentials, for devices that run them themselves.

use half::f16;

use super::checks::{fits, refused};
use crate::error::RenderError;

/// A fully connected layer, y = x W + b.
#[derive(Debug, Clone, Copy)]
pub struct DenseParts<'a> {
    /// Row-major [inputs, outputs].
    pub weights: &'a [f16],
    /// `[outputs]`.
    pub bias: &'a [f32],
}

/// What [`BoundMesh::with_networks`](super::bound_mesh::BoundMesh::with_networks) takes, as plain arrays, for a mesh of N_v vertices, C controllers and B bases that is driven by P
/// parameters. SiLU follows the layers that are named so.
///
/// The mesh (F_mesh of the paper): parameters -> `first`, SiLU -> `second`, SiLU -> `code`, R numbers -> canonical vertices, `rest` and the
/// weighted sum of R fields. The controllers (F_attr): parameters -> `controllers_first`, SiLU: H hidden units of each controller side by side
/// -> each controller's own second layer, B potentials.
#[derive(Debug, Clone, Copy)]
pub struct NetworkParts<'a> {
    /// P -> hidden units; SiLU follows.
    pub first: DenseParts<'a>,
    /// Hidden -> hidden units; SiLU follows.
    pub second: DenseParts<'a>,
    /// Hidden units -> R.
    pub code: DenseParts<'a>,
    /// Fields, row-major [R, 3 N_v] (planes x, y, z): metres = value x scale x unit.
    pub fields: &'a [i8],
    /// Relative scales of the coordinates, [3 N_v].
    pub scales: &'a [f16],
    /// Metres a step of a scale.
    pub unit: f32,
    /// The mesh where the code is 0: [3 N_v], metres.
    pub rest: &'a [f32],
    /// P -> C x H; SiLU follows.
    pub controllers_first: DenseParts<'a>,
    /// Each controller's second layer, row-major [C, H, B].
    pub controllers_second: &'a [f16],
    /// Row-major [C, B].
    pub controllers_bias: &'a [f32],
}

/// Layers beside one another, as `shaders/dense.comp` reads them.
#[derive(Clone)]
pub(super) struct Layers {
    pub(super) layers: u32,
    pub(super) inputs: u32,
    pub(super) pairs: u32,
    /// [layers, inputs, pairs], filled up with zeros.
    pub(super) weights: Vec<[f16; 2]>,
    /// [layers, pairs].
    pub(super) bias: Vec<[f32; 2]>,
}

/// The networks, checked and ready for upload.
#[derive(Clone)]
pub(super) struct Networks {
    pub(super) parameters: u32,
    pub(super) first: Layers,
    pub(super) second: Layers,
    pub(super) code: Layers,
    pub(super) controllers_first: Layers,
    pub(super) controllers_second: Layers,
    /// Fours of coordinates, and what `shaders/decode_vertices.comp` reads of them.
    pub(super) fours: u32,
    pub(super) fields: u32,
    pub(super) values: Vec<[i8; 4]>,
    pub(super) scales: Vec<[f16; 4]>,
    pub(super) rest: Vec<[f32; 4]>,
    pub(super) unit: f32,
}

impl Networks {
    /// Checks the parts and lays them out, for a mesh of so many vertices, controllers and bases, with room for `stride` potentials from one
    /// controller's to the next one's.
    pub(super) fn new(
        parts: &NetworkParts<'_>,
        vertices: u32,
        [controllers, bases, stride]: [u32; 3],
    ) -> Result<Self, RenderError> {
        let [controllers, bases, stride] = [controllers, bases, stride].map(|count| count as usize);
        let coordinates = 3 * vertices as usize;
        let hidden = parts.first.bias.len();
        let parameters = parts.first.inputs("its mesh's first layer")?;
        let width = parts.second.bias.len();
        let ranks = parts.code.bias.len();
        let units = parts.controllers_first.bias.len();
        if width == 0 || ranks == 0 || units == 0 || !units.is_multiple_of(controllers) {
            return Err(refused(format!(
                "its networks have a second layer of {width}, a code of {ranks} numbers and {units} hidden units for {controllers} controllers"
            )));
        }
        let counts = [
            (
                "weights of its mesh's second layer",
                parts.second.weights.len(),
                hidden.saturating_mul(width),
            ),
            (
                "weights of its mesh's code",
                parts.code.weights.len(),
                width.saturating_mul(ranks),
            ),
            (
                "numbers of its fields",
                parts.fields.len(),
                ranks.saturating_mul(coordinates),
            ),
            ("scales of its fields", parts.scales.len(), coordinates),
            ("coordinates at rest", parts.rest.len(), coordinates),
            (
                "weights of its controllers' first layer",
                parts.controllers_first.weights.len(),
                parameters.saturating_mul(units),
            ),
            (
                "weights of its controllers' second layers",
                parts.controllers_second.len(),
                units.saturating_mul(bases),
            ),
            (
                "biases of its controllers' second layers",
                parts.controllers_bias.len(),
                controllers.saturating_mul(bases),
            ),
        ];
        for (what, got, expected) in counts {
            if got != expected {
                return Err(refused(format!("{got} {what}, not {expected}")));
            }
        }
        let of = |dense: &DenseParts<'_>, outputs: usize| {
            Layers::pack(1, [outputs, outputs.next_multiple_of(2)], *dense)
        };
        let fours = coordinates.div_ceil(4);
        Ok(Self {
            parameters: fits("parameters", parameters)?,
            first: of(&parts.first, hidden)?,
            second: of(&parts.second, width)?,
            code: of(&parts.code, ranks)?,
            controllers_first: of(&parts.controllers_first, units)?,
            controllers_second: Layers::pack(
                controllers,
                // What fills a controller's potentials up is 0, as `pose_gaussians.comp` expects.
                [bases, stride],
                DenseParts {
                    weights: parts.controllers_second,
                    bias: parts.controllers_bias,
                },
            )?,
            fours: fits("coordinates", fours)?,
            fields: fits("fields", ranks)?,
            values: parts
                .fields
                .chunks_exact(coordinates)
                .flat_map(in_fours)
                .collect(),
            scales: in_fours(parts.scales).collect(),
            rest: in_fours(parts.rest).collect(),
            unit: parts.unit,
        })
    }
}

impl DenseParts<'_> {
    fn inputs(&self, what: &str) -> Result<usize, RenderError> {
        let (weights, outputs) = (self.weights.len(), self.bias.len());
        match weights.checked_div(outputs) {
            Some(inputs) if inputs > 0 && inputs * outputs == weights => Ok(inputs),
            _ => Err(refused(format!(
                "{weights} weights for {outputs} outputs of {what}"
            ))),
        }
    }
}

impl Layers {
    /// Lays `layers` equal layers out, each of `outputs` outputs, filled up to `width`, which is even.
    fn pack(
        layers: usize,
        [outputs, width]: [usize; 2],
        dense: DenseParts<'_>,
    ) -> Result<Self, RenderError> {
        let rows = dense.weights.chunks_exact(outputs);
        let weights = rows.flat_map(|row| in_pairs(row, width)).collect();
        let rows = dense.bias.chunks_exact(outputs);
        let bias = rows.flat_map(|row| in_pairs(row, width)).collect();
        Ok(Self {
            layers: fits("layers", layers)?,
            inputs: fits("inputs", dense.weights.len() / (layers * outputs))?,
            pairs: fits("outputs", width / 2)?,
            weights,
            bias,
        })
    }

    /// How many outputs there are, together.
    pub(super) fn outputs(&self) -> u64 {
        2 * u64::from(self.layers) * u64::from(self.pairs)
    }
}

fn in_pairs<T: Copy + Default>(row: &[T], width: usize) -> impl Iterator<Item = [T; 2]> {
    (0..width / 2).map(move |pair| {
        [2 * pair, 2 * pair + 1].map(|at| row.get(at).copied().unwrap_or_default())
    })
}

fn in_fours<T: Copy + Default>(row: &[T]) -> impl Iterator<Item = [T; 4]> {
    row.chunks(4)
        .map(|four| std::array::from_fn(|at| four.get(at).copied().unwrap_or_default()))
}
