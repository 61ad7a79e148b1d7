//! The template mesh in T-pose and its skinning weights.

use crate::{JOINTS, PersonError};
use glam::Vec3;

/// Joints that may move one vertex.
pub const INFLUENCES: usize = 4;

/// Skinning weights of one vertex: up to four joints and their shares, which sum to 1. Unused slots have weight 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SkinWeights {
    /// Joint indices in SMPL-X's order.
    pub joints: [u8; INFLUENCES],
    /// The joints' shares, 0..=1.
    pub weights: [f32; INFLUENCES],
}

impl SkinWeights {
    /// Weight of every joint, `[55]`.
    #[must_use]
    pub fn dense(&self) -> [f32; JOINTS] {
        let mut dense = [0.0; JOINTS];
        for (joint, weight) in self.joints.iter().zip(self.weights) {
            if let Some(slot) = dense.get_mut(usize::from(*joint)) {
                *slot += weight;
            }
        }
        dense
    }
}

/// V_template of the paper: one triangle mesh of body, garments and hair, in T-pose, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    vertices: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    skin: Vec<SkinWeights>,
}

impl Template {
    /// Takes N_v vertices (metres), N_f counter-clockwise triangles and N_v vertices' skinning weights.
    ///
    /// # Errors
    /// If the counts differ, an index is out of range, a coordinate is not finite (or beyond 100 m), or a vertex'
    /// weights are negative or do not sum to 1 within 1e-3.
    pub fn new(
        vertices: Vec<Vec3>,
        faces: Vec<[u32; 3]>,
        skin: Vec<SkinWeights>,
    ) -> Result<Self, PersonError> {
        PersonError::check_count("skinning weights", skin.len(), vertices.len())?;
        PersonError::check_range(
            "vertex coordinate",
            bytemuck::cast_slice(&vertices),
            -100.0,
            100.0,
            "-100..100 m",
        )?;
        let corners = faces.iter().flatten().map(|v| *v as usize);
        PersonError::check_indices("face corner", corners, vertices.len())?;
        let joints = skin.iter().flat_map(|s| s.joints).map(usize::from);
        PersonError::check_indices("skinning joint", joints, JOINTS)?;
        for (at, weights) in skin.iter().map(|s| s.weights).enumerate() {
            PersonError::check_range("skinning weight", &weights, 0.0, 1.0, "0..1")?;
            let sum: f32 = weights.iter().sum();
            if (sum - 1.0).abs() > 1e-3 {
                return Err(PersonError::Value {
                    what: "sum of skinning weights",
                    at,
                    value: sum,
                    range: "1",
                });
            }
        }
        Ok(Self {
            vertices,
            faces,
            skin,
        })
    }

    /// `[N_v]` T-pose positions, metres.
    #[must_use]
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// `[N_f]` counter-clockwise triangles.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// `[N_v]` skinning weights.
    #[must_use]
    pub fn skin(&self) -> &[SkinWeights] {
        &self.skin
    }

    /// The dense, transposed skinning matrix W^T, row-major [55, N_v], as the deform graph multiplies it.
    #[must_use]
    pub fn dense_weights_transposed(&self) -> Vec<f32> {
        let count = self.vertices.len();
        let mut dense = vec![0.0; JOINTS * count];
        for (vertex, skin) in self.skin.iter().enumerate() {
            for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                dense[usize::from(*joint) * count + vertex] += weight;
            }
        }
        dense
    }
}
