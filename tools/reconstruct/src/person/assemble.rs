//! Puts body and proxies together in the rest pose: one list of quads over one list of vertices, each of which knows
//! where it is bound to the body, so that a morphed body moves all of them.

use super::pieces::connected;
use super::recipe::{Item, Pieces};
use super::transfer::Source;
use super::{Part, recipe};
use crate::ReconstructError;
use crate::makehuman::{Anchor, BoneWeights, Model, Package, Proxy, Quad, Rig};
use glam::{Vec2, Vec3};
use std::cell::LazyCell;
use std::collections::BTreeMap;

/// Millimetre-scale corrections of the teeth, which otherwise stand through this face's lips.
const TEETH_BACK: f32 = 0.035;
const TEETH_WIDTH: f32 = 0.92;

/// The tongue lies against the palate in the file; in an open mouth it must not hide the teeth.
const TONGUE_BACK: f32 = 0.10;
const TONGUE_DOWN: f32 = 0.06;

/// The person before posing: quads over vertices anchored on the body.
pub(super) struct Assembly {
    /// Faces; corners index the lists below.
    pub(super) quads: Vec<Quad>,
    /// Part of each face.
    pub(super) parts: Vec<Part>,
    /// Where each vertex is bound to the body, and the scale of its offset.
    pub(super) anchors: Vec<(Anchor, Vec3)>,
    /// Weights over the rig's bones.
    pub(super) weights: Vec<BoneWeights>,
    /// Part of each vertex (of one of its faces).
    pub(super) vertex_parts: Vec<Part>,
}

impl Assembly {
    /// Reads the recipe's items and joins them with the parts of the body that they leave visible.
    pub(super) fn new(
        package: &Package,
        model: &Model,
        rig: &Rig,
        body: &[Vec3],
    ) -> Result<Self, ReconstructError> {
        let mut assembly = Self {
            quads: Vec::new(),
            parts: Vec::new(),
            anchors: Vec::new(),
            weights: Vec::new(),
            vertex_parts: Vec::new(),
        };
        let mut covered = vec![false; model.vertices.len()];
        let mut proxies = Vec::new();
        for item in &recipe::ITEMS {
            let path = package.data(&format!("proxies/{}", item.model));
            let proxy = Proxy::read(&path, model)?;
            for (slot, covers) in covered.iter_mut().zip(&proxy.covers) {
                *slot |= covers;
            }
            let parts = label(item, &proxy).map_err(|w| ReconstructError::content(&path, w))?;
            proxies.push((item, proxy, parts));
        }
        let visible =
            |quad: &&Quad| quad.material == 0 && !quad.corners.iter().all(|v| covered[*v as usize]);
        let skin: Vec<Quad> = model.quads.iter().filter(visible).copied().collect();
        // Garments take weights from what they cover, too.
        let bare = model.quads.iter().filter(|quad| quad.material == 0);
        let bare: Vec<Quad> = bare.copied().collect();
        let source = LazyCell::new(|| Source::new(body, &bare, &model.weights));
        let regions = BodyRegions::new(rig, body, &model.weights);
        let parts: Vec<Part> = skin.iter().map(|q| regions.part(q)).collect();
        let anchors: Vec<Anchor> = (0..)
            .take(model.vertices.len())
            .map(Anchor::body_vertex)
            .collect();
        assembly.add(&skin, &parts, &anchors, &model.weights, Vec3::ONE);
        for (item, proxy, parts) in &proxies {
            let scale = item.made_on.scale(body);
            let own: Option<Vec<BoneWeights>> = proxy.weights.iter().copied().collect();
            let weights = own.map_or_else(
                || {
                    let position = |anchor: &Anchor| anchor.position(body, scale);
                    let vertices: Vec<Vec3> = proxy.anchors.iter().map(position).collect();
                    source.transfer(&vertices, &proxy.quads, &proxy.weights)
                },
                Ok,
            );
            let weights = weights.map_err(|what| {
                let path = package.data(&format!("proxies/{}", item.model));
                ReconstructError::content(&path, what)
            })?;
            assembly.add(&proxy.quads, parts, &proxy.anchors, &weights, scale);
        }
        Ok(assembly)
    }

    /// Adds faces, and of the vertices those in use.
    fn add(
        &mut self,
        quads: &[Quad],
        parts: &[Part],
        anchors: &[Anchor],
        weights: &[BoneWeights],
        scale: Vec3,
    ) {
        let mut renumbered: BTreeMap<u32, u32> = BTreeMap::new();
        for (quad, part) in quads.iter().zip(parts) {
            if *part == Part::Eyes && is_cornea(quad) {
                continue;
            }
            let mut quad = *quad;
            for corner in &mut quad.corners {
                let old = *corner as usize;
                let next = u32::try_from(self.anchors.len()).unwrap_or(u32::MAX);
                *corner = *renumbered.entry(*corner).or_insert(next);
                if *corner == next {
                    self.anchors.push((anchors[old], scale));
                    self.weights.push(weights[old]);
                    self.vertex_parts.push(*part);
                }
            }
            self.quads.push(quad);
            self.parts.push(*part);
        }
    }

    /// Vertices on a morphed body, decimetres.
    pub(super) fn vertices(&self, body: &[Vec3]) -> Vec<Vec3> {
        let mut vertices: Vec<Vec3> = self
            .anchors
            .iter()
            .map(|(anchor, scale)| anchor.position(body, *scale))
            .collect();
        for (vertex, part) in vertices.iter_mut().zip(&self.vertex_parts) {
            *vertex = corrected(*vertex, *part);
        }
        vertices
    }

    /// How the vertices move when the body's move by `offsets`.
    pub(super) fn offsets(&self, offsets: &[Vec3]) -> Vec<Vec3> {
        self.anchors
            .iter()
            .map(|(anchor, _)| anchor.interpolate(offsets))
            .collect()
    }
}

/// A vertex of the rest pose, decimetres, where it is to be: teeth and tongue moved a little.
pub(super) fn corrected(mut vertex: Vec3, part: Part) -> Vec3 {
    if part == Part::Teeth {
        vertex.z -= TEETH_BACK;
        vertex.x *= TEETH_WIDTH;
    } else if part == Part::Tongue {
        vertex -= Vec3::new(0.0, TONGUE_DOWN, TONGUE_BACK);
    }
    vertex
}

/// The clear shell over the eye, which Gaussians cannot show; its texture lies in a corner of its own.
pub(super) fn is_cornea(quad: &Quad) -> bool {
    let centre = quad.uvs.iter().sum::<Vec2>() / 4.0;
    centre.x > 0.87 && centre.y < 0.13
}

/// Labels the faces of a proxy.
fn label(item: &Item, proxy: &Proxy) -> Result<Vec<Part>, String> {
    let pieces = match item.pieces {
        Pieces::One(part) => return Ok(vec![part; proxy.quads.len()]),
        Pieces::ByCount(pieces) => pieces,
    };
    let roots = connected(proxy.anchors.len(), &proxy.quads);
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for root in &roots {
        *counts.entry(*root).or_default() += 1;
    }
    proxy
        .quads
        .iter()
        .map(|quad| {
            let count = counts[&roots[quad.corners[0] as usize]];
            pieces
                .iter()
                .find(|(size, _)| *size == count)
                .map(|(_, part)| *part)
                .ok_or_else(|| format!("a piece of {count} vertices is not in the recipe"))
        })
        .collect()
}

/// Which bones move head or hand, and where the face ends.
pub(super) struct BodyRegions<'a> {
    body: &'a [Vec3],
    weights: &'a [BoneWeights],
    head: Vec<bool>,
    hand: Vec<bool>,
    /// Behind this the head is ears, scalp and nape, decimetres.
    face_behind: f32,
}

impl<'a> BodyRegions<'a> {
    pub(super) fn new(rig: &Rig, body: &'a [Vec3], weights: &'a [BoneWeights]) -> Self {
        use super::joints::joint_of_bone;
        use spmm3::Joint::{Head, Jaw, LeftEye, LeftWrist, RightEye, RightWrist};
        let of = |wanted: &dyn Fn(spmm3::Joint) -> bool| {
            rig.bones()
                .iter()
                .map(|b| joint_of_bone(&b.name).is_some_and(wanted))
                .collect()
        };
        let heads = rig.heads(body);
        let at = |bone: &str| rig.find(bone).map_or(0.0, |i| heads[i].z);
        Self {
            body,
            weights,
            head: of(&|j| matches!(j, Head | Jaw | LeftEye | RightEye)),
            hand: of(&|j| {
                matches!(j, LeftWrist | RightWrist) || j.index() >= spmm3::Joint::LeftIndex1.index()
            }),
            face_behind: at("eye.L") - 0.55,
        }
    }

    pub(super) fn part(&self, quad: &Quad) -> Part {
        let share = |bones: &[bool]| -> f32 {
            let corner = |v: &u32| -> f32 {
                self.weights[*v as usize]
                    .iter()
                    .filter(|(bone, _)| bones.get(usize::from(*bone)) == Some(&true))
                    .map(|(_, w)| w)
                    .sum()
            };
            quad.corners.iter().map(corner).sum::<f32>() / 4.0
        };
        if share(&self.hand) > 0.5 {
            Part::Hand
        } else if share(&self.head) > 0.5 {
            let z = quad
                .corners
                .iter()
                .map(|v| self.body[*v as usize].z)
                .sum::<f32>()
                / 4.0;
            if z > self.face_behind {
                Part::Face
            } else {
                Part::Head
            }
        } else {
            Part::Skin
        }
    }
}
