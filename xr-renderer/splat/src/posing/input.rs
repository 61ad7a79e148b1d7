//! One pose's numbers, and how they are laid out for the device.

use super::bound_mesh::BoundMesh;
use crate::error::RenderError;

/// Rows of a 3x4 matrix by its numbers, column after column.
const MATRIX: usize = 12;

/// What moves a [`BoundMesh`] in one motion frame.
#[derive(Debug, Clone, Copy)]
pub struct PosedInput<'a> {
    /// The mesh before skinning and the controllers' pull, or what they are computed from.
    pub deformation: Deformation<'a>,
    /// `posed_from_rest` of each joint, row-major [12, joints]: row `3 * column + row` holds that element of its 3x4 matrix.
    pub skinning: &'a [f32],
    /// Added to every position, metres.
    pub root: [f32; 3],
}

/// What a pose's networks gave, or what the device is to give them.
#[derive(Debug, Clone, Copy)]
pub enum Deformation<'a> {
    /// Computed elsewhere.
    Computed {
        /// Vertices before skinning, row-major [3, N_v], metres.
        canonical_vertices: &'a [f32],
        /// The controllers' displacement potentials, row-major [C, B].
        potentials: &'a [f32],
    },
    /// The input of the mesh's own networks, `[P]`; the device runs them.
    Parameters(&'a [f32]),
}

/// Names a state on the device: one pose, from the moment it was pushed until four more were, or the device was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StateId {
    /// Where it was pushed.
    pub(super) ring: u64,
    /// How many were pushed there before it.
    pub(super) number: u64,
}

/// Where the parts of a pose lie in its slot, in numbers of 32 bits: matrices as rows of four, three a joint; parameters of networks;
/// potentials, each controller's filled up to whole blocks of 16; canonical vertices. Each begins at a whole vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlotLayout {
    joints: usize,
    /// Of the mesh's networks; 0 without.
    parameters: usize,
    controllers: usize,
    bases: usize,
    /// Numbers from one controller's potentials to the next one's.
    potential_stride: usize,
    vertices: usize,
}

impl SlotLayout {
    pub(super) fn of(mesh: &BoundMesh) -> Self {
        Self {
            joints: mesh.joints as usize,
            parameters: mesh.parameters().unwrap_or(0) as usize,
            controllers: mesh.controllers as usize,
            bases: mesh.bases as usize,
            potential_stride: mesh.blocks as usize * 16,
            vertices: mesh.vertices as usize,
        }
    }

    /// Where the networks' parameters begin.
    pub(super) fn parameters(&self) -> usize {
        MATRIX * self.joints
    }

    /// Where the potentials begin.
    pub(super) fn potentials(&self) -> usize {
        (self.parameters() + self.parameters).next_multiple_of(4)
    }

    /// Where the canonical vertices begin.
    pub(super) fn vertices(&self) -> usize {
        self.potentials() + self.potential_stride * self.controllers
    }

    /// Numbers from one slot to the next.
    pub(super) fn stride(&self) -> usize {
        (self.vertices() + 3 * self.vertices).next_multiple_of(4)
    }

    /// Refuses an input of other sizes.
    pub(super) fn check(&self, input: &PosedInput<'_>) -> Result<(), RenderError> {
        let skinning = (
            "skinning transforms' numbers",
            input.skinning.len(),
            MATRIX * self.joints,
        );
        let deformation = match input.deformation {
            Deformation::Computed {
                canonical_vertices,
                potentials,
            } => [
                (
                    "canonical vertex coordinates",
                    canonical_vertices.len(),
                    3 * self.vertices,
                ),
                (
                    "potentials",
                    potentials.len(),
                    self.controllers * self.bases,
                ),
            ],
            Deformation::Parameters(_) if self.parameters == 0 => {
                return Err(RenderError::NoNetworks);
            }
            Deformation::Parameters(parameters) => {
                [("parameters", parameters.len(), self.parameters); 2]
            }
        };
        for (what, got, expected) in deformation.into_iter().chain([skinning]) {
            if got != expected {
                return Err(RenderError::PosedInput {
                    what,
                    got,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Lays out everything but the vertices, whose layout is the slot's already, and returns how much of `out` that is. `out` has room
    /// up to them; what fills controllers up is never written and stays 0.
    pub(super) fn arrange(&self, input: &PosedInput<'_>, out: &mut [f32]) -> usize {
        let (matrices, rest) = out.split_at_mut(self.parameters());
        for (joint, matrix) in matrices.chunks_exact_mut(MATRIX).enumerate() {
            for (at, number) in matrix.iter_mut().enumerate() {
                let (row, column) = (at / 4, at % 4);
                *number = input.skinning[(3 * column + row) * self.joints + joint];
            }
        }
        let (given, held) = rest.split_at_mut(self.potentials() - self.parameters());
        match input.deformation {
            Deformation::Computed { potentials, .. } => {
                let rows = potentials.chunks_exact(self.bases);
                for (held, row) in held.chunks_exact_mut(self.potential_stride).zip(rows) {
                    held[..self.bases].copy_from_slice(row);
                }
                self.vertices()
            }
            Deformation::Parameters(parameters) => {
                given[..self.parameters].copy_from_slice(parameters);
                self.potentials()
            }
        }
    }
}
