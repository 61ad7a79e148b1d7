//! Writes an avatar as a `.m3a` package.

use super::archive;
use super::compiled;
use super::manifest::{
    self, Counts, FORMAT, GENERATOR, MANIFEST, Manifest, MemberEntry, VERSION, VERSION_EXTENDED,
    VERSION_PLAIN,
};
use super::members::{
    BINDING, CONTROLLERS, GAUSSIANS, HEIRS, MEMBERS, ORDER, Packed, TEMPLATE, ports, signature,
};
use super::signed::{self, SIGNATURE};
use super::tensors::Writer;
use super::{Avatar, PackageError};
use crate::{ATTRIBUTES, INFLUENCES, JOINTS, NEIGHBOURS, PARAMS};
use half::f16;
use identity::Identity;
use std::fs::File;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

impl Avatar {
    /// Writes the package to `path` and returns its size in bytes. The file is complete or, on an error, what it was
    /// before: everything is written beside it first and moved into place.
    ///
    /// # Errors
    /// If the avatar's parts do not fit each other (the package is read back before it is written) or the file cannot
    /// be written.
    pub fn save(&self, path: &Path) -> Result<u64, PackageError> {
        write(path, &self.to_bytes()?)
    }

    /// As [`Self::save`], with the owner's signature: receivers let nobody else drive it, but whom the owner permits ([`identity::Permit`]).
    ///
    /// # Errors
    /// As [`Self::save`].
    pub fn save_signed(&self, path: &Path, owner: &Identity) -> Result<u64, PackageError> {
        write(path, &self.bytes(Some(owner))?)
    }

    /// The package's bytes, without a signature. Equal avatars give equal bytes.
    ///
    /// # Errors
    /// If the avatar's parts do not fit each other.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackageError> {
        self.bytes(None)
    }

    fn bytes(&self, owner: Option<&Identity>) -> Result<Vec<u8>, PackageError> {
        let signature = signature(&self.deform_graph)?;
        let (compiled, compiled_entries): (Vec<_>, Vec<_>) =
            compiled::pack(&self.compiled, &signature)?
                .into_iter()
                .unzip();
        let names = compiled_entries.iter().map(|entry| entry.member.as_str());
        let packed: Vec<_> = MEMBERS
            .into_iter()
            .zip(pack(self)?)
            .chain(names.zip(compiled))
            .collect();
        let members = packed
            .iter()
            .map(|(name, (bytes, tensors))| MemberEntry {
                name: (*name).to_owned(),
                bytes: bytes.len() as u64,
                sha256: archive::sha256(bytes),
                tensors: tensors.clone(),
            })
            .collect();
        let manifest = Manifest {
            format: FORMAT.into(),
            version: if owner.is_some() {
                VERSION
            } else if self.compiled.is_empty() && self.importance.is_none() {
                VERSION_PLAIN
            } else {
                VERSION_EXTENDED
            },
            name: self.name.clone(),
            generator: format!("{GENERATOR}{}", env!("CARGO_PKG_VERSION")),
            provenance: self.provenance.clone(),
            licence: self.licence.clone(),
            conventions: manifest::conventions(),
            counts: Counts {
                vertices: self.template.vertices().len(),
                faces: self.template.faces().len(),
                gaussians: self.gaussians.len(),
                controllers: self.controllers.vertices().len(),
                bases: signature.bases,
                joints: JOINTS,
                motion: PARAMS,
            },
            members,
            compiled: compiled_entries.clone(),
            expression_basis: Some(self.expression_basis.clone()),
            expressions: self
                .expressions
                .iter()
                .map(|(name, preset)| (name.clone(), preset.into()))
                .collect(),
            pose_range: self.pose_range.as_ref().map(Into::into),
            report: self.report.clone(),
            signer: None,
        };
        let text = serde_json::to_vec_pretty(&manifest)
            .map_err(|e| PackageError::member(MANIFEST, e.to_string()))?;
        let signed = owner.map(|owner| (SIGNATURE, signed::pack(owner, &text)));
        let mut files = vec![(MANIFEST, text)];
        files.extend(signed);
        files.extend(packed.into_iter().map(|(name, (bytes, _))| (name, bytes)));
        let bytes = archive::write(&files)?;
        // A package that the reader refuses must not be written.
        drop(files);
        Self::read(Cursor::new(&bytes))?;
        Ok(bytes)
    }
}

/// Writes the file whole or not at all; how many bytes.
fn write(path: &Path, bytes: &[u8]) -> Result<u64, PackageError> {
    let mut partial = PathBuf::from(path).into_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    let written = File::create(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()));
    let moved = match written {
        Ok(()) => std::fs::rename(&partial, path).map_err(|e| ("replace", e)),
        Err(e) => Err(("write", e)),
    };
    moved.map_err(|(action, source)| {
        // Best effort: the error that is returned says what went wrong.
        let _ = std::fs::remove_file(&partial);
        PackageError::File {
            action,
            path: path.to_path_buf(),
            source,
        }
    })?;
    Ok(bytes.len() as u64)
}

/// The members of an avatar, in the order of [`MEMBERS`].
fn pack(avatar: &Avatar) -> Result<[Packed; 5], PackageError> {
    let graph = &avatar.deform_graph;
    Ok([
        pack_template(avatar)?,
        pack_gaussians(avatar)?,
        pack_binding(avatar)?,
        pack_controllers(avatar)?,
        (graph.clone(), ports(&signature(graph)?)),
    ])
}

fn pack_template(avatar: &Avatar) -> Result<Packed, PackageError> {
    let (vertices, faces) = (avatar.template.vertices(), avatar.template.faces());
    let skin = avatar.template.skin();
    let joints: Vec<u8> = skin.iter().flat_map(|s| s.joints).collect();
    let weights: Vec<f32> = skin.iter().flat_map(|s| s.weights).collect();
    let rest = avatar.skeleton.rest_positions();
    let count = vertices.len();
    Writer::new(TEMPLATE)
        .add("vertices", &[count, 3], flat::<f32, _>(vertices))?
        .add("faces", &[faces.len(), 3], flat::<u32, _>(faces))?
        .add("joints", &[JOINTS, 3], flat::<f32, _>(rest))?
        .add("skin_joints", &[count, INFLUENCES], &joints)?
        .add("skin_weights", &[count, INFLUENCES], &weights)?
        .finish()
}

fn pack_gaussians(avatar: &Avatar) -> Result<Packed, PackageError> {
    let kept = avatar.gaussians.clone().quantised();
    let attributes = halves(kept.attributes());
    let count = avatar.gaussians.len();
    let writer = Writer::new(GAUSSIANS).add("attributes", &[ATTRIBUTES, count], &attributes)?;
    let Some(importance) = &avatar.importance else {
        return writer.finish();
    };
    let writer = writer.add(ORDER, &[count], importance.order())?;
    match importance.heirs() {
        None => writer.finish(),
        Some(heirs) => writer.add(HEIRS, &[count], heirs)?.finish(),
    }
}

fn pack_binding(avatar: &Avatar) -> Result<Packed, PackageError> {
    let count = avatar.gaussians.len();
    let barycentric = halves(flat(avatar.gaussians.barycentrics()));
    Writer::new(BINDING)
        .add("triangle", &[count], avatar.gaussians.triangles())?
        .add("barycentric", &[count, 2], &barycentric)?
        .finish()
}

fn pack_controllers(avatar: &Avatar) -> Result<Packed, PackageError> {
    let controllers = &avatar.controllers;
    let count = controllers.neighbours().len();
    let neighbours = flat::<u16, _>(controllers.neighbours());
    let masses = flat::<f32, _>(controllers.masses());
    Writer::new(CONTROLLERS)
        .add(
            "vertex",
            &[controllers.vertices().len()],
            controllers.vertices(),
        )?
        .add("neighbours", &[count, NEIGHBOURS], neighbours)?
        .add("masses", &[count, NEIGHBOURS], masses)?
        .finish()
}

fn flat<T: bytemuck::Pod, N: bytemuck::Pod>(nested: &[N]) -> &[T] {
    bytemuck::cast_slice(nested)
}

fn halves(values: &[f32]) -> Vec<f16> {
    values.iter().map(|value| f16::from_f32(*value)).collect()
}
