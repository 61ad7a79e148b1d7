//! A three.js JSON model, format 3.1: vertices, textured quads, skinning weights.

use super::package::read_json;
use crate::ReconstructError;
use glam::{Vec2, Vec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Bones that may move one vertex in the files.
const INFLUENCES: usize = 4;

/// Skinning weights of one vertex over the rig's bones; they sum to 1, unused slots have weight 0.
pub type BoneWeights = [(u16, f32); INFLUENCES];

/// One textured quad, counter-clockwise seen from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quad {
    /// Vertices.
    pub corners: [u32; 4],
    /// Texture coordinates at the corners, v up.
    pub uvs: [Vec2; 4],
    /// Material, which is the group of the original OBJ file.
    pub material: u32,
}

/// A decoded model. Proxies carry more: see [`super::Proxy`].
#[derive(Debug, Clone)]
pub struct Model {
    /// Vertices, decimetres.
    pub vertices: Vec<Vec3>,
    /// Faces.
    pub quads: Vec<Quad>,
    /// Skinning weights per vertex.
    pub weights: Vec<BoneWeights>,
    /// Name and parent entry of the file's bone list, two entries a bone.
    pub(super) bones: Vec<RawBone>,
    /// Vertices whose mean is a joint, by joint.
    pub(super) joint_vertices: BTreeMap<String, Vec<u32>>,
    /// Proxies only: which body vertices to hide.
    pub(super) delete: Vec<bool>,
    /// Proxies only: the fit to the body.
    pub(super) fit: Vec<([u32; 3], [f32; 3], [f32; 3])>,
    pub(super) path: PathBuf,
}

#[derive(Debug, Clone, Deserialize)]
pub(super) struct RawBone {
    pub(super) name: String,
    pub(super) parent: i32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct RawModel {
    vertices: Vec<f32>,
    uvs: Vec<Vec<f32>>,
    faces: Vec<u32>,
    // A garment may come without a skin.
    #[serde(default)]
    bones: Vec<RawBone>,
    #[serde(default)]
    skin_indices: Vec<u32>,
    #[serde(default)]
    skin_weights: Vec<f32>,
    #[serde(default = "four")]
    influences_per_vertex: usize,
    #[serde(default)]
    metadata: RawMetadata,
    #[serde(default, rename = "ref_vIdxs")]
    references: Vec<[u32; 3]>,
    #[serde(default)]
    weights: Vec<[f32; 3]>,
    #[serde(default)]
    offsets: Vec<[f32; 3]>,
}

#[derive(Deserialize, Default)]
struct RawMetadata {
    #[serde(default)]
    joint_pos_idxs: BTreeMap<String, Vec<u32>>,
    #[serde(default, rename = "deleteVerts")]
    delete: Vec<u8>,
}

fn four() -> usize {
    INFLUENCES
}

impl Model {
    /// Reads a model and checks it: every index in range, every number finite, one weight row a vertex.
    ///
    /// # Errors
    /// If the file cannot be read, is no such JSON, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, ReconstructError> {
        let (mut model, rows) = Self::read_with_gaps(path)?;
        let whole = |(vertex, row): (usize, Option<BoneWeights>)| {
            let why = || ReconstructError::content(path, format!("vertex {vertex} has no bone"));
            row.ok_or_else(why)
        };
        model.weights = rows
            .into_iter()
            .enumerate()
            .map(whole)
            .collect::<Result<_, _>>()?;
        Ok(model)
    }

    /// Reads a model whose vertices may lack weights: they come as a list of their own, the model's is empty.
    pub(super) fn read_with_gaps(
        path: &Path,
    ) -> Result<(Self, Vec<Option<BoneWeights>>), ReconstructError> {
        let raw: RawModel = read_json(path)?;
        let wrong = |what: String| ReconstructError::content(path, what);
        let vertices = triples(&raw.vertices)
            .ok_or_else(|| wrong("vertices are not finite triples".into()))?;
        let uvs: Vec<Vec2> = match raw.uvs.first() {
            Some(flat) if flat.len() % 2 == 0 && flat.iter().all(|v| v.is_finite()) => flat
                .chunks_exact(2)
                .map(|c| Vec2::new(c[0], c[1]))
                .collect(),
            _ => return Err(wrong("texture coordinates are not finite pairs".into())),
        };
        if raw.uvs.len() != 1 {
            return Err(wrong(format!(
                "{} layers of texture coordinates",
                raw.uvs.len()
            )));
        }
        let quads = decode_faces(&raw.faces, vertices.len(), &uvs).map_err(wrong)?;
        let weights = decode_weights(&raw, vertices.len()).map_err(wrong)?;
        let fit = if raw.references.is_empty() {
            Vec::new()
        } else {
            if [raw.references.len(), raw.weights.len(), raw.offsets.len()] != [vertices.len(); 3] {
                return Err(wrong("the fit to the body has the wrong length".into()));
            }
            let numbers = raw.weights.iter().chain(&raw.offsets).flatten();
            if !numbers.clone().all(|v| v.is_finite()) {
                return Err(wrong("the fit to the body is not finite".into()));
            }
            raw.references
                .into_iter()
                .zip(raw.weights)
                .zip(raw.offsets)
                .map(|((r, w), o)| (r, w, o))
                .collect()
        };
        let out_of_range = raw
            .metadata
            .joint_pos_idxs
            .iter()
            .find(|(_, v)| v.is_empty() || v.iter().any(|i| *i as usize >= vertices.len()));
        if let Some((name, _)) = out_of_range.filter(|_| fit.is_empty()) {
            return Err(wrong(format!("joint {name} names no vertices of the mesh")));
        }
        let model = Self {
            vertices,
            quads,
            weights: Vec::new(),
            bones: raw.bones,
            joint_vertices: raw.metadata.joint_pos_idxs,
            delete: raw.metadata.delete.into_iter().map(|v| v != 0).collect(),
            fit,
            path: path.to_path_buf(),
        };
        Ok((model, weights))
    }
}

fn triples(flat: &[f32]) -> Option<Vec<Vec3>> {
    let whole = flat.len().is_multiple_of(3) && flat.iter().all(|v| v.is_finite());
    whole.then(|| flat.chunks_exact(3).map(Vec3::from_slice).collect())
}

/// Decodes the flat face records. The bits of a record's first number say which fields follow.
fn decode_faces(flat: &[u32], vertices: usize, uvs: &[Vec2]) -> Result<Vec<Quad>, String> {
    const QUAD: u32 = 1;
    const MATERIAL: u32 = 1 << 1;
    const FACE_UV: u32 = 1 << 2;
    const UVS: u32 = 1 << 3;
    let mut quads = Vec::with_capacity(flat.len() / 10);
    let mut rest = flat;
    while let Some((kind, body)) = rest.split_first() {
        let at = quads.len();
        if kind & (QUAD | UVS) != QUAD | UVS || *kind > 0xff {
            return Err(format!("face {at} has type {kind}, not a textured quad"));
        }
        let one = |bit: u32| usize::from(kind & bit != 0);
        let material_at = 4;
        let uv_at = material_at + one(MATERIAL) + one(FACE_UV);
        // Normals and colours, per face and per corner, are skipped.
        let length = uv_at + 4 + one(1 << 4) + 4 * one(1 << 5) + one(1 << 6) + 4 * one(1 << 7);
        if body.len() < length {
            return Err(format!("face {at} is cut short"));
        }
        let corners = [body[0], body[1], body[2], body[3]];
        if corners.iter().any(|v| *v as usize >= vertices) {
            return Err(format!(
                "face {at} names vertices {corners:?} of {vertices}"
            ));
        }
        let mut corner_uvs = [Vec2::ZERO; 4];
        for (slot, index) in corner_uvs.iter_mut().zip(&body[uv_at..uv_at + 4]) {
            *slot = *uvs
                .get(*index as usize)
                .ok_or_else(|| format!("face {at} names texture coordinate {index}"))?;
        }
        quads.push(Quad {
            corners,
            uvs: corner_uvs,
            material: if kind & MATERIAL == 0 {
                0
            } else {
                body[material_at]
            },
        });
        rest = &body[length..];
    }
    Ok(quads)
}

/// Reads 1 to 4 influences a vertex, `None` for one without a bone. Indices are even because the file lists every
/// bone twice.
fn decode_weights(raw: &RawModel, vertices: usize) -> Result<Vec<Option<BoneWeights>>, String> {
    if raw.skin_indices.is_empty() && raw.skin_weights.is_empty() {
        return Ok(vec![None; vertices]);
    }
    let per = raw.influences_per_vertex;
    if !(1..=INFLUENCES).contains(&per) {
        return Err(format!("{per} influences a vertex"));
    }
    if [raw.skin_indices.len(), raw.skin_weights.len()] != [vertices * per; 2] {
        return Err("the skinning weights have the wrong length".into());
    }
    let rows = raw
        .skin_indices
        .chunks_exact(per)
        .zip(raw.skin_weights.chunks_exact(per));
    rows.enumerate()
        .map(|(vertex, (indices, weights))| {
            let mut row = [(0, 0.0); INFLUENCES];
            for (slot, (index, weight)) in row.iter_mut().zip(indices.iter().zip(weights)) {
                let known = (*index as usize) < raw.bones.len();
                if !known || !(0.0..=2.0).contains(weight) {
                    return Err(format!(
                        "vertex {vertex} has bone {index} with weight {weight}"
                    ));
                }
                let bone = u16::try_from(index / 2).map_err(|_| "too many bones".to_owned())?;
                *slot = (bone, *weight);
            }
            let sum: f32 = row.iter().map(|(_, w)| w).sum();
            if sum < 1e-3 {
                return Ok(None);
            }
            row.iter_mut().for_each(|(_, w)| *w /= sum);
            Ok(Some(row))
        })
        .collect()
}
