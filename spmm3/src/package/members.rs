//! What each member holds: an avatar's parts as tensors, checked against the manifest.

use super::archive::{self, Archive, MAX_BYTES};
use super::error::GRAPH;
use super::manifest::Counts;
use super::tensors::Reader;
use super::{Manifest, PackageError, TensorEntry};
use crate::networks::{DeformGraph, GraphSignature, input, output};
use crate::{
    ATTRIBUTES, BoundGaussians, Controllers, INFLUENCES, Importance, JOINTS, NEIGHBOURS, PARAMS,
    Skeleton, SkinWeights, Template,
};
use glam::Vec3;
use half::f16;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

pub(super) const TEMPLATE: &str = "template.safetensors";
pub(super) const GAUSSIANS: &str = "gaussians.safetensors";
pub(super) const BINDING: &str = "binding.safetensors";
pub(super) const CONTROLLERS: &str = "controllers.safetensors";
/// The tensors of [`GAUSSIANS`] that may be missing: packages of format version 1 have neither.
pub(super) const ORDER: &str = "order";
pub(super) const HEIRS: &str = "heirs";
/// The members, in their order in the archive.
pub(super) const MEMBERS: [&str; 5] = [TEMPLATE, GAUSSIANS, BINDING, CONTROLLERS, GRAPH];

/// One member ready to be packed: its bytes and its tensors.
pub(super) type Packed = (Vec<u8>, BTreeMap<String, TensorEntry>);

/// A member's bytes, once size and hash are the manifest's.
pub(super) fn unpack<'m, R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &'m Manifest,
    name: &str,
    limit: u64,
) -> Result<(Vec<u8>, &'m BTreeMap<String, TensorEntry>), PackageError> {
    let entry = manifest
        .member(name)
        .ok_or_else(|| PackageError::member(name, "missing from the manifest"))?;
    let bytes = archive.unpack(name, entry.bytes.min(limit))?;
    if bytes.len() as u64 != entry.bytes {
        let reason = format!("{} bytes, not {}", bytes.len(), entry.bytes);
        return Err(PackageError::member(name, reason));
    }
    if archive::sha256(&bytes) != entry.sha256 {
        return Err(PackageError::member(
            name,
            "its SHA-256 is not the manifest's: the package was damaged or altered",
        ));
    }
    Ok((bytes, &entry.tensors))
}

pub(super) fn unpack_template<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
) -> Result<(Skeleton, Template), PackageError> {
    let (bytes, listed) = unpack(archive, manifest, TEMPLATE, MAX_BYTES)?;
    let member = Reader::new(TEMPLATE, &bytes, listed)?;
    let count = manifest.counts.vertices;
    let vertices: Vec<f32> = member.get("vertices", &[count, 3])?;
    let faces: Vec<u32> = member.get("faces", &[manifest.counts.faces, 3])?;
    let rest: Vec<f32> = member.get("joints", &[JOINTS, 3])?;
    let joints: Vec<u8> = member.get("skin_joints", &[count, INFLUENCES])?;
    let weights: Vec<f32> = member.get("skin_weights", &[count, INFLUENCES])?;
    member.only(5)?;
    let mut rest_positions = [Vec3::ZERO; JOINTS];
    for (position, values) in rest_positions.iter_mut().zip(triples(&rest)) {
        *position = Vec3::from_array(values);
    }
    let skin = joints.as_chunks().0.iter().zip(weights.as_chunks().0);
    let skin = skin
        .map(|(joints, weights)| SkinWeights {
            joints: *joints,
            weights: *weights,
        })
        .collect();
    let vertices = triples(&vertices).map(Vec3::from_array).collect();
    let faces = triples(&faces).collect();
    let template = Template::new(vertices, faces, skin).map_err(PackageError::contents(TEMPLATE));
    let skeleton = Skeleton::new(rest_positions).map_err(PackageError::contents(TEMPLATE));
    Ok((skeleton?, template?))
}

pub(super) fn unpack_gaussians<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    template: &Template,
) -> Result<(BoundGaussians, Option<Importance>), PackageError> {
    let count = manifest.counts.gaussians;
    let (bytes, listed) = unpack(archive, manifest, GAUSSIANS, MAX_BYTES)?;
    let member = Reader::new(GAUSSIANS, &bytes, listed)?;
    let attributes: Vec<f16> = member.get("attributes", &[ATTRIBUTES, count])?;
    let optional = |name: &str| {
        let listed = listed.contains_key(name);
        listed.then(|| member.get(name, &[count])).transpose()
    };
    let (order, heirs): (Option<Vec<u32>>, Option<Vec<u32>>) = (optional(ORDER)?, optional(HEIRS)?);
    // Heirs without an order say nothing.
    member.only(1 + usize::from(order.is_some()) * (1 + usize::from(heirs.is_some())))?;
    let importance = order
        .map(|order| Importance::new(order, heirs, count))
        .transpose()
        .map_err(PackageError::contents(GAUSSIANS))?;
    let (bytes, listed) = unpack(archive, manifest, BINDING, MAX_BYTES)?;
    let member = Reader::new(BINDING, &bytes, listed)?;
    let triangles: Vec<u32> = member.get("triangle", &[count])?;
    let barycentric: Vec<f16> = member.get("barycentric", &[count, 2])?;
    member.only(2)?;
    let barycentrics = barycentric.as_chunks().0.iter();
    let barycentrics = barycentrics.map(|pair: &[f16; 2]| pair.map(f16::to_f32));
    let attributes = attributes.iter().map(|value| value.to_f32()).collect();
    let gaussians = BoundGaussians::new(template, triangles, barycentrics.collect(), attributes)
        .map_err(PackageError::contents(BINDING))?;
    Ok((gaussians, importance))
}

pub(super) fn unpack_controllers<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    template: &Template,
) -> Result<Controllers, PackageError> {
    let (bytes, listed) = unpack(archive, manifest, CONTROLLERS, MAX_BYTES)?;
    let member = Reader::new(CONTROLLERS, &bytes, listed)?;
    let counts = &manifest.counts;
    let vertices = member.get("vertex", &[counts.controllers])?;
    let neighbours: Vec<u16> = member.get("neighbours", &[counts.gaussians, NEIGHBOURS])?;
    let masses: Vec<f32> = member.get("masses", &[counts.gaussians, NEIGHBOURS])?;
    member.only(3)?;
    Controllers::new(
        template,
        vertices,
        triples(&neighbours).collect(),
        triples(&masses).collect(),
    )
    .map_err(PackageError::contents(CONTROLLERS))
}

/// The graph, if it is the one that these counts, this template and these controllers demand.
pub(super) fn unpack_graph<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    template: &Template,
    controllers: &Controllers,
) -> Result<Vec<u8>, PackageError> {
    let (bytes, listed) = unpack(archive, manifest, GRAPH, MAX_BYTES)?;
    let signature = signature(&bytes)?;
    check_signature(&signature, &manifest.counts)?;
    DeformGraph::check(&bytes, template, controllers).map_err(PackageError::graph)?;
    if ports(&signature) != *listed {
        let reason = "its inputs and outputs are not those the manifest lists";
        return Err(PackageError::member(GRAPH, reason));
    }
    Ok(bytes)
}

/// What the graph declares.
pub(super) fn signature(graph: &[u8]) -> Result<GraphSignature, PackageError> {
    GraphSignature::read(graph).map_err(PackageError::graph)
}

fn check_signature(signature: &GraphSignature, counts: &Counts) -> Result<(), PackageError> {
    let port = |name: &str, shape: &[usize]| (name.to_owned(), shape.to_vec());
    let expected = GraphSignature {
        inputs: vec![
            port(input::MOTION, &[1, PARAMS]),
            port(input::SKINNING, &[12, JOINTS]),
        ],
        outputs: vec![
            port(output::VERTICES, &[3, counts.vertices]),
            port(output::RESIDUALS, &[ATTRIBUTES, counts.gaussians]),
        ],
        bases: counts.bases,
    };
    if *signature == expected {
        return Ok(());
    }
    let reason = format!("it is {signature:?}, but the manifest's counts need {expected:?}");
    Err(PackageError::member(GRAPH, reason))
}

/// The graph's inputs and outputs as the manifest lists them.
pub(super) fn ports(signature: &GraphSignature) -> BTreeMap<String, TensorEntry> {
    let all = signature.inputs.iter().chain(&signature.outputs);
    all.map(|(name, shape)| {
        let entry = TensorEntry {
            dtype: "F32".into(),
            shape: shape.clone(),
        };
        (name.clone(), entry)
    })
    .collect()
}

fn triples<T: Copy>(flat: &[T]) -> impl Iterator<Item = [T; 3]> {
    flat.as_chunks().0.iter().copied()
}
