//! One pose's numbers, and how they are laid out for the device.

use super::bound_mesh::BoundMesh;
use crate::error::RenderError;

/// Rows of a 3x4 matrix by its numbers, column after column.
const MATRIX: usize = 12;

/// What moves a [`BoundMesh`] in one motion frame.
#[derive(Debug, Clone, Copy)]
pub struct PosedInput<'a> {
    /// Vertices before skinning, row-major [3, N_v], metres.
    pub canonical_vertices: &'a [f32],
    /// `posed_from_rest` of each joint, row-major [12, joints]: row `3 * column + row` holds that element of its 3x4 matrix.
    pub skinning: &'a [f32],
    /// The controllers' displacement potentials, row-major [C, B].
    pub potentials: &'a [f32],
    /// Added to every position, metres.
    pub root: [f32; 3],
}

/// Names a state on the device: one pose, from the moment it was pushed until four more were, or the device was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StateId {
    /// Where it was pushed.
    pub(super) ring: u64,
    /// How many were pushed there before it.
    pub(super) number: u64,
}

/// Where the parts of a pose lie in its slot, in numbers of 32 bits: matrices as rows of four, three a joint; potentials,
/// each controller's filled up to whole blocks of 16; canonical vertices.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlotLayout {
    joints: usize,
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
            controllers: mesh.controllers as usize,
            bases: mesh.bases as usize,
            potential_stride: mesh.blocks as usize * 16,
            vertices: mesh.vertices as usize,
        }
    }

    /// Where the potentials begin.
    pub(super) fn potentials(&self) -> usize {
        MATRIX * self.joints
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
        let counts = [
            (
                "canonical vertex coordinates",
                input.canonical_vertices.len(),
                3 * self.vertices,
            ),
            (
                "skinning transforms' numbers",
                input.skinning.len(),
                MATRIX * self.joints,
            ),
            (
                "potentials",
                input.potentials.len(),
                self.controllers * self.bases,
            ),
        ];
        for (what, got, expected) in counts {
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

    /// Lays out everything but the vertices, whose layout is the slot's already. `out` has room up to them; what fills
    /// controllers up is never written and stays 0.
    pub(super) fn arrange(&self, input: &PosedInput<'_>, out: &mut [f32]) {
        let (matrices, potentials) = out.split_at_mut(self.potentials());
        for (joint, matrix) in matrices.chunks_exact_mut(MATRIX).enumerate() {
            for (at, number) in matrix.iter_mut().enumerate() {
                let (row, column) = (at / 4, at % 4);
                *number = input.skinning[(3 * column + row) * self.joints + joint];
            }
        }
        let rows = input.potentials.chunks_exact(self.bases);
        for (held, row) in potentials.chunks_exact_mut(self.potential_stride).zip(rows) {
            held[..self.bases].copy_from_slice(row);
        }
    }
}
