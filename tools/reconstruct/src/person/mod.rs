//! The person an avatar is built from: a template in T-pose with labels, textures and an expression basis, and
//! Gaussians on its surface. It decides what the person looks like; how cloth moves and what the networks learn is
//! decided elsewhere.

mod assemble;
mod bare;
mod bridges;
mod closest;
mod demo;
mod expression;
mod gaussians;
mod joints;
mod loose;
mod mixes;
mod pieces;
mod range_of_motion;
mod recipe;
mod surface;
mod texture;
mod tpose;
mod transfer;
mod visible;

use crate::Part;
pub use bare::BareBody;
pub use expression::{EXPRESSIONS_USED, expression_basis};
pub use gaussians::{ColouredGaussians, build_gaussians, shaded_colour};
pub use texture::Texture;

use glam::{Affine3A, Vec2, Vec3};
use spmm3::{Expressions, Joint, MotionParams, Skeleton, SkinningTransforms, Template};

/// A textured, skinned person in T-pose with a face that can talk.
///
/// Metres, y up, soles at y = 0, facing +z, arms along x.
#[derive(Debug, Clone)]
pub struct Person {
    template: Template,
    skeleton: Skeleton,
    parts: Vec<Part>,
    uvs: Vec<[Vec2; 3]>,
    textures: Vec<Texture>,
    expressions: Vec<Vec<Vec3>>,
    presets: Expressions,
    mixes: Vec<Vec<f32>>,
    bridges: Vec<(u32, u32)>,
}

impl Person {
    /// The mesh `[N_v]` in T-pose. Its triangles come in pairs: 2q and 2q + 1 are the halves 012 and 023 of quad q.
    #[must_use]
    pub fn template(&self) -> &Template {
        &self.template
    }

    /// The 55 joints in T-pose.
    #[must_use]
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// `[N_f]` part of each triangle.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// `[N_f]` texture coordinates at each triangle's corners, v up.
    #[must_use]
    pub fn uvs(&self) -> &[[Vec2; 3]] {
        &self.uvs
    }

    /// The texture of a part.
    #[must_use]
    pub fn texture(&self, part: Part) -> &Texture {
        &self.textures[part.index()]
    }

    /// `[16][N_v]` offsets in T-pose, metres per unit of the expression coefficient of that number. Coefficients past
    /// these move nothing.
    #[must_use]
    pub fn expressions(&self) -> &[Vec<Vec3>] {
        &self.expressions
    }

    /// Named expressions.
    #[must_use]
    pub fn presets(&self) -> &Expressions {
        &self.presets
    }

    /// `[16][34]` what share each of MakeHuman's expression units (in the order of their names) has in a coefficient of the basis, unit length.
    #[must_use]
    pub fn expression_mixes(&self) -> &[Vec<f32>] {
        &self.mixes
    }

    /// Pairs of vertices where separate surfaces (body, garments, hair) touch: for [`spmm3::EdgeGraph::new`].
    #[must_use]
    pub fn bridges(&self) -> &[(u32, u32)] {
        &self.bridges
    }

    /// The T-pose with a facial expression: the template's vertices plus the basis weighted by `coefficients`.
    #[must_use]
    pub fn expressed(&self, coefficients: &[f32]) -> Vec<Vec3> {
        let mut vertices = self.template.vertices().to_vec();
        for (coefficient, offsets) in coefficients.iter().zip(&self.expressions) {
            if *coefficient != 0.0 {
                for (vertex, offset) in vertices.iter_mut().zip(offsets) {
                    *vertex += *coefficient * *offset;
                }
            }
        }
        vertices
    }

    /// The mesh `[N_v]` of a motion by linear blend skinning alone, root translation left out: metres, the person's space.
    #[must_use]
    pub fn posed(&self, motion: &MotionParams) -> Vec<Vec3> {
        let mut transforms = SkinningTransforms::default();
        self.skeleton
            .skinning(&self.skeleton.pose(motion), &mut transforms);
        let maps: [Affine3A; spmm3::JOINTS] = Joint::ALL.map(|j| transforms.posed_from_rest(j));
        self.expressed(motion.expression())
            .iter()
            .zip(self.template.skin())
            .map(|(vertex, skin)| {
                let moved = |(joint, weight): (&u8, f32)| {
                    maps[usize::from(*joint)].transform_point3(*vertex) * weight
                };
                skin.joints.iter().zip(skin.weights).map(moved).sum()
            })
            .collect()
    }

    /// One part per vertex: that of the last triangle that uses it.
    #[must_use]
    pub fn vertex_parts(&self) -> Vec<Part> {
        let mut parts = vec![Part::Skin; self.template.vertices().len()];
        for (face, part) in self.template.faces().iter().zip(&self.parts) {
            for corner in face {
                parts[*corner as usize] = *part;
            }
        }
        parts
    }
}
