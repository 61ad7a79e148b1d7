//! Proxies: clothes, hair, eyes and the like, fitted to a morphed body by their references to its vertices.

use super::{BoneWeights, Model, Quad};
use crate::ReconstructError;
use glam::Vec3;
use std::path::Path;

/// Where a proxy's vertex is bound to the body: a weighted mean of three body vertices plus a scaled offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// Body vertices.
    pub references: [u32; 3],
    /// Their shares.
    pub weights: [f32; 3],
    /// Offset for a body of the reference's size, decimetres.
    pub offset: Vec3,
}

impl Anchor {
    /// A body vertex as itself.
    #[must_use]
    pub fn body_vertex(vertex: u32) -> Self {
        Self {
            references: [vertex; 3],
            weights: [1.0, 0.0, 0.0],
            offset: Vec3::ZERO,
        }
    }

    /// The weighted mean of `values`, one a body vertex.
    #[must_use]
    pub fn interpolate(&self, values: &[Vec3]) -> Vec3 {
        self.references
            .iter()
            .zip(self.weights)
            .filter_map(|(r, w)| values.get(*r as usize).map(|v| *v * w))
            .sum()
    }

    /// The vertex on a morphed body.
    #[must_use]
    pub fn position(&self, body: &[Vec3], scale: Vec3) -> Vec3 {
        self.interpolate(body) + self.offset * scale
    }
}

/// The body a proxy was made on: its size tells how much offsets scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScaleReference {
    /// Made on the male body.
    Male,
    /// Made on the neutral body.
    Neutral,
    /// Made on the unmorphed base mesh.
    Base,
}

impl ScaleReference {
    /// Scale of the offsets on a morphed body: its size between marker vertices over the reference's, by axis. One
    /// where the body is too small to hold the markers.
    #[must_use]
    pub fn scale(self, body: &[Vec3]) -> Vec3 {
        const MARKERS: [(usize, usize); 3] = [(5399, 11998), (791, 881), (962, 5320)];
        let sizes = match self {
            Self::Male => [1.4340, 2.4098, 2.0001],
            Self::Neutral => [1.4160, 2.3073, 1.9231],
            Self::Base => [1.48, 2.3298, 1.9221],
        };
        let mut scale = Vec3::ONE;
        for (axis, ((a, b), size)) in MARKERS.into_iter().zip(sizes).enumerate() {
            if let (Some(a), Some(b)) = (body.get(a), body.get(b)) {
                scale[axis] = (a[axis] - b[axis]).abs() / size;
            }
        }
        scale
    }
}

/// A decoded proxy.
#[derive(Debug, Clone)]
pub struct Proxy {
    /// Faces over the proxy's own vertices.
    pub quads: Vec<Quad>,
    /// Skinning weights per vertex over the body's bones; `None` where the file has none: the body's are to be taken.
    pub weights: Vec<Option<BoneWeights>>,
    /// Where each vertex is bound.
    pub anchors: Vec<Anchor>,
    /// Body vertices that this proxy covers: empty, or one flag a body vertex.
    pub covers: Vec<bool>,
}

impl Proxy {
    /// Reads a proxy for `body`.
    ///
    /// # Errors
    /// If the file cannot be read, has no fit to the body, or names vertices or bones the body lacks.
    pub fn read(path: &Path, body: &Model) -> Result<Self, ReconstructError> {
        let (model, weights) = Model::read_with_gaps(path)?;
        let wrong = |what: &str| ReconstructError::content(path, what);
        let bound = body.vertices.len();
        if model.fit.is_empty() {
            return Err(wrong("it has no fit to the body (ref_vIdxs)"));
        }
        if model
            .fit
            .iter()
            .any(|(r, ..)| r.iter().any(|v| *v as usize >= bound))
        {
            return Err(wrong("its fit names vertices the body lacks"));
        }
        if !matches!(model.delete.len(), n if n == 0 || n == bound) {
            return Err(wrong("deleteVerts does not have one flag a body vertex"));
        }
        let same = |(a, b): (&super::model::RawBone, &super::model::RawBone)| a.name == b.name;
        let bones_match =
            model.bones.len() == body.bones.len() && model.bones.iter().zip(&body.bones).all(same);
        // Bones without vertices are not checked.
        if !bones_match && weights.iter().any(Option::is_some) {
            return Err(wrong("its bones are not the body's"));
        }
        let anchors = model
            .fit
            .into_iter()
            .map(|(references, weights, offset)| Anchor {
                references,
                weights,
                offset: Vec3::from_array(offset),
            })
            .collect();
        Ok(Self {
            quads: model.quads,
            weights,
            anchors,
            covers: model.delete,
        })
    }
}
