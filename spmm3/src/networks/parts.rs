//! Which parts of the deform graph one ONNX model computes: the rest is for kernels of our own, on another unit.

use crate::{ATTRIBUTES, JOINTS, PARAMS};

/// What a deform graph computes of F_mesh -> LBS and F_attr's controllers -> F_attr's tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GraphParts {
    /// Everything: `posed_vertices` [3, N_v] and `residuals` [14, N_g]. What a package holds.
    Whole,
    /// All but F_attr's tail: `posed_vertices` [3, N_v] and `potentials` [C, B].
    Skinned,
    /// The networks alone, from `motion` only: `canonical_vertices` [3, N_v] and `potentials` [C, B].
    Networks,
}

/// By which operators a graph computes its parts. The numbers are the same to within rounding; inputs, outputs and their shapes are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Dialect {
    /// What a package holds, and what every provider but NNAPI takes.
    #[default]
    Package,
    /// What NNAPI's graph builder in ONNX Runtime takes whole: it has no ReduceSum, and takes a batched MatMul apart into four operations for each of the
    /// batch's members, with weights that are computed, which few drivers have. Both are means times a number that is folded into a constant.
    Nnapi,
}

/// An input or output: its name and its static shape, float.
pub type Port = (&'static str, [usize; 2]);

/// The sizes of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GraphSizes {
    /// Template vertices N_v.
    pub vertices: usize,
    /// Gaussians N_g.
    pub gaussians: usize,
    /// Controllers C.
    pub controllers: usize,
    /// Deformation bases B.
    pub bases: usize,
}

/// A graph's inputs and outputs, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GraphPorts {
    /// `motion`, and `skinning` unless the graph leaves LBS out.
    pub inputs: Vec<Port>,
    /// The vertices, then residuals or potentials.
    pub outputs: Vec<Port>,
}

impl GraphParts {
    /// The inputs and outputs of a graph of these parts.
    #[must_use]
    pub fn ports(self, sizes: &GraphSizes) -> GraphPorts {
        let mut inputs = vec![(input::MOTION, [1, PARAMS])];
        if self != Self::Networks {
            inputs.push((input::SKINNING, [12, JOINTS]));
        }
        let vertices = match self {
            Self::Whole | Self::Skinned => output::VERTICES,
            Self::Networks => output::CANONICAL_VERTICES,
        };
        let attributes = match self {
            Self::Whole => (output::RESIDUALS, [ATTRIBUTES, sizes.gaussians]),
            Self::Skinned | Self::Networks => {
                (output::POTENTIALS, [sizes.controllers, sizes.bases])
            }
        };
        GraphPorts {
            inputs,
            outputs: vec![(vertices, [3, sizes.vertices]), attributes],
        }
    }
}

/// Names of the graph's inputs.
pub mod input {
    /// [1, 215] motion parameters P.
    pub const MOTION: &str = "motion";
    /// [12, 55] skinning transforms, planes as in [`crate::SkinningTransforms`].
    pub const SKINNING: &str = "skinning";
}

/// Names of the graph's outputs. Which of them a graph has depends on its [`GraphParts`].
pub mod output {
    /// [3, N_v] posed vertices, metres, root translation left out.
    pub const VERTICES: &str = "posed_vertices";
    /// [3, N_v] vertices in T-pose with F_mesh's offsets, metres: what skinning starts from.
    pub const CANONICAL_VERTICES: &str = "canonical_vertices";
    /// [14, N_g] attribute residuals in the triangles' frames.
    pub const RESIDUALS: &str = "residuals";
    /// [C, B] displacement potentials u_j of every controller: what F_attr's tail starts from.
    pub const POTENTIALS: &str = "potentials";
}
