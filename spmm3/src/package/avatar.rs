//! An avatar in memory, and its way into and out of a `.m3a` package.

use super::archive::{self, Archive, MAX_BYTES};
use super::manifest::{self, Counts, FORMAT, MANIFEST, Manifest, MemberEntry, VERSION};
use super::tensors::{Reader, Writer};
use super::{PackageError, TensorEntry};
use crate::networks::{GraphSignature, input, output};
use crate::{
    ATTRIBUTES, BoundGaussians, Controllers, Expressions, INFLUENCES, JOINTS, NEIGHBOURS, PARAMS,
    Skeleton, SkinWeights, Template,
};
use glam::Vec3;
use half::f16;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, Write};
use std::path::{Path, PathBuf};

const TEMPLATE: &str = "template.safetensors";
const GAUSSIANS: &str = "gaussians.safetensors";
const BINDING: &str = "binding.safetensors";
const CONTROLLERS: &str = "controllers.safetensors";
const GRAPH: &str = "deform.onnx";
/// The members of format version 1, in their order in the archive.
const MEMBERS: [&str; 5] = [TEMPLATE, GAUSSIANS, BINDING, CONTROLLERS, GRAPH];

/// The manifest is parsed into a tree, which takes more memory than its text.
const MAX_MANIFEST: u64 = 1 << 20;

/// A person's double, whole: what a package holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Avatar {
    /// The avatar's name.
    pub name: String,
    /// Where its data came from, in words.
    pub provenance: String,
    /// What one may do with it, in words.
    pub licence: String,
    /// The 55 joints in T-pose.
    pub skeleton: Skeleton,
    /// V_template and its skinning weights.
    pub template: Template,
    /// G_template and its binding to the template.
    pub gaussians: BoundGaussians,
    /// Which controllers hold each Gaussian.
    pub controllers: Controllers,
    /// Named expressions.
    pub expressions: Expressions,
    /// F_mesh, LBS and F_attr as one ONNX graph ([`crate::networks::DeformGraph::to_onnx`]).
    pub deform_graph: Vec<u8>,
    /// What the builder measured (errors, times), free in form.
    pub report: serde_json::Value,
}

/// One member ready to be packed.
type Packed = (Vec<u8>, BTreeMap<String, TensorEntry>);

impl Avatar {
    /// The avatar as a reader of its package sees it: Gaussians rounded to half precision
    /// ([`BoundGaussians::quantised`]). Saving and loading gives exactly this.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        self.gaussians = self.gaussians.quantised();
        self
    }

    /// Writes the package to `path` and returns its size in bytes. The file is complete or, on an error, what it was
    /// before: everything is written beside it first and moved into place.
    ///
    /// # Errors
    /// If the avatar's parts do not fit each other (the package is read back before it is written) or the file cannot
    /// be written.
    pub fn save(&self, path: &Path) -> Result<u64, PackageError> {
        let bytes = self.to_bytes()?;
        let mut partial = PathBuf::from(path).into_os_string();
        partial.push(format!(".{}.partial", std::process::id()));
        let partial = PathBuf::from(partial);
        let written = File::create(&partial)
            .and_then(|mut file| file.write_all(&bytes).and_then(|()| file.sync_all()));
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

    /// The package's bytes. Equal avatars give equal bytes.
    ///
    /// # Errors
    /// If the avatar's parts do not fit each other.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackageError> {
        let packed = [
            self.pack_template()?,
            self.pack_gaussians()?,
            self.pack_binding()?,
            self.pack_controllers()?,
            self.pack_graph()?,
        ];
        let entries = MEMBERS.iter().zip(&packed);
        let members = entries
            .map(|(name, (bytes, tensors))| MemberEntry {
                name: (*name).to_owned(),
                bytes: bytes.len() as u64,
                sha256: archive::sha256(bytes),
                tensors: tensors.clone(),
            })
            .collect();
        let manifest = Manifest {
            format: FORMAT.into(),
            version: VERSION,
            name: self.name.clone(),
            generator: concat!("mon3tr ", env!("CARGO_PKG_VERSION")).into(),
            provenance: self.provenance.clone(),
            licence: self.licence.clone(),
            conventions: manifest::conventions(),
            counts: Counts {
                vertices: self.template.vertices().len(),
                faces: self.template.faces().len(),
                gaussians: self.gaussians.len(),
                controllers: self.controllers.vertices().len(),
                bases: self.signature()?.bases,
                joints: JOINTS,
                motion: PARAMS,
            },
            members,
            expressions: self
                .expressions
                .iter()
                .map(|(name, preset)| (name.clone(), preset.into()))
                .collect(),
            report: self.report.clone(),
        };
        let text = serde_json::to_vec_pretty(&manifest)
            .map_err(|e| PackageError::member(MANIFEST, e.to_string()))?;
        let mut files = vec![(MANIFEST, text)];
        files.extend(MEMBERS.into_iter().zip(packed.map(|(bytes, _)| bytes)));
        let bytes = archive::write(&files)?;
        // A package that its own reader refuses must not leave the house.
        drop(files);
        Self::read(Cursor::new(&bytes))?;
        Ok(bytes)
    }

    /// Reads the package at `path`.
    ///
    /// # Errors
    /// If the file cannot be read, or anything in it is not as the manifest says; nothing of it is used then.
    pub fn load(path: &Path) -> Result<Self, PackageError> {
        Self::read(open(path)?)
    }

    /// Reads a package.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn read(reader: impl Read + Seek) -> Result<Self, PackageError> {
        let mut archive = Archive::open(reader)?;
        let manifest = Manifest::from_archive(&mut archive)?;
        let counts = manifest.counts;
        let expressions = manifest.presets()?;
        let (skeleton, template) = unpack_template(&mut archive, &manifest)?;
        let gaussians = unpack_gaussians(&mut archive, &manifest, &template)?;
        let controllers = unpack_controllers(&mut archive, &manifest, &template)?;
        let (deform_graph, _) = unpack(&mut archive, &manifest, GRAPH)?;
        let signature = GraphSignature::read(&deform_graph)
            .map_err(|e| PackageError::member(GRAPH, e.to_string()))?;
        check_signature(&signature, &counts)?;
        if manifest.member(GRAPH).map(|m| &m.tensors) != Some(&ports(&signature)) {
            let reason = "its inputs and outputs are not those the manifest lists";
            return Err(PackageError::member(GRAPH, reason));
        }
        Ok(Self {
            name: manifest.name,
            provenance: manifest.provenance,
            licence: manifest.licence,
            skeleton,
            template,
            gaussians,
            controllers,
            expressions,
            deform_graph,
            report: manifest.report,
        })
    }

    fn pack_template(&self) -> Result<Packed, PackageError> {
        let (vertices, faces) = (self.template.vertices(), self.template.faces());
        let skin = self.template.skin();
        let joints: Vec<u8> = skin.iter().flat_map(|s| s.joints).collect();
        let weights: Vec<f32> = skin.iter().flat_map(|s| s.weights).collect();
        let rest = self.skeleton.rest_positions();
        let count = vertices.len();
        Writer::new(TEMPLATE)
            .add("vertices", &[count, 3], flat::<f32, _>(vertices))?
            .add("faces", &[faces.len(), 3], flat::<u32, _>(faces))?
            .add("joints", &[JOINTS, 3], flat::<f32, _>(rest))?
            .add("skin_joints", &[count, INFLUENCES], &joints)?
            .add("skin_weights", &[count, INFLUENCES], &weights)?
            .finish()
    }

    fn pack_gaussians(&self) -> Result<Packed, PackageError> {
        let attributes = halves(self.gaussians.attributes());
        Writer::new(GAUSSIANS)
            .add(
                "attributes",
                &[ATTRIBUTES, self.gaussians.len()],
                &attributes,
            )?
            .finish()
    }

    fn pack_binding(&self) -> Result<Packed, PackageError> {
        let count = self.gaussians.len();
        let barycentric = halves(flat(self.gaussians.barycentrics()));
        Writer::new(BINDING)
            .add("triangle", &[count], self.gaussians.triangles())?
            .add("barycentric", &[count, 2], &barycentric)?
            .finish()
    }

    fn pack_controllers(&self) -> Result<Packed, PackageError> {
        let controllers = &self.controllers;
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

    fn pack_graph(&self) -> Result<Packed, PackageError> {
        Ok((self.deform_graph.clone(), ports(&self.signature()?)))
    }

    fn signature(&self) -> Result<GraphSignature, PackageError> {
        GraphSignature::read(&self.deform_graph)
            .map_err(|e| PackageError::member(GRAPH, e.to_string()))
    }
}

impl Manifest {
    /// Reads only the table of contents of the package at `path`; the members stay unchecked.
    ///
    /// # Errors
    /// If the file cannot be read, is no package, or its manifest is broken or newer than this program.
    pub fn load(path: &Path) -> Result<Self, PackageError> {
        Self::from_archive(&mut Archive::open(open(path)?)?)
    }

    /// Reads the manifest and checks that the archive holds what it lists and nothing else.
    fn from_archive<R: Read + Seek>(archive: &mut Archive<R>) -> Result<Self, PackageError> {
        let manifest = Self::parse(&archive.unpack(MANIFEST, MAX_MANIFEST)?)?;
        let mut listed: Vec<&str> = manifest.members.iter().map(|m| m.name.as_str()).collect();
        listed.push(MANIFEST);
        listed.sort_unstable();
        let mut present = archive.names();
        present.sort_unstable();
        if present != listed {
            return Err(PackageError::archive(format!(
                "it holds {present:?}, but its manifest lists {listed:?}"
            )));
        }
        let mut known: Vec<&str> = MEMBERS.into_iter().chain([MANIFEST]).collect();
        known.sort_unstable();
        if listed != known {
            return Err(PackageError::archive(format!(
                "it holds {listed:?}, but a package holds {known:?}"
            )));
        }
        Ok(manifest)
    }
}

fn open(path: &Path) -> Result<BufReader<File>, PackageError> {
    File::open(path)
        .map(BufReader::new)
        .map_err(|source| PackageError::File {
            action: "open",
            path: path.to_path_buf(),
            source,
        })
}

/// A member's bytes, once size and hash are the manifest's.
fn unpack<'m, R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &'m Manifest,
    name: &str,
) -> Result<(Vec<u8>, &'m BTreeMap<String, TensorEntry>), PackageError> {
    let entry = manifest
        .member(name)
        .ok_or_else(|| PackageError::member(name, "missing from the manifest"))?;
    let bytes = archive.unpack(name, entry.bytes.min(MAX_BYTES))?;
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

fn unpack_template<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
) -> Result<(Skeleton, Template), PackageError> {
    let (bytes, listed) = unpack(archive, manifest, TEMPLATE)?;
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

fn unpack_gaussians<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    template: &Template,
) -> Result<BoundGaussians, PackageError> {
    let count = manifest.counts.gaussians;
    let (bytes, listed) = unpack(archive, manifest, GAUSSIANS)?;
    let member = Reader::new(GAUSSIANS, &bytes, listed)?;
    let attributes: Vec<f16> = member.get("attributes", &[ATTRIBUTES, count])?;
    member.only(1)?;
    let (bytes, listed) = unpack(archive, manifest, BINDING)?;
    let member = Reader::new(BINDING, &bytes, listed)?;
    let triangles: Vec<u32> = member.get("triangle", &[count])?;
    let barycentric: Vec<f16> = member.get("barycentric", &[count, 2])?;
    member.only(2)?;
    let barycentrics = barycentric.as_chunks().0.iter();
    let barycentrics = barycentrics.map(|pair: &[f16; 2]| pair.map(f16::to_f32));
    let attributes = attributes.iter().map(|value| value.to_f32()).collect();
    BoundGaussians::new(template, triangles, barycentrics.collect(), attributes)
        .map_err(PackageError::contents(BINDING))
}

fn unpack_controllers<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &Manifest,
    template: &Template,
) -> Result<Controllers, PackageError> {
    let (bytes, listed) = unpack(archive, manifest, CONTROLLERS)?;
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

/// The graph must take and give exactly what the counts demand.
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
fn ports(signature: &GraphSignature) -> BTreeMap<String, TensorEntry> {
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

fn flat<T: bytemuck::Pod, N: bytemuck::Pod>(nested: &[N]) -> &[T] {
    bytemuck::cast_slice(nested)
}

fn halves(values: &[f32]) -> Vec<f16> {
    values.iter().map(|value| f16::from_f32(*value)).collect()
}

fn triples<T: Copy>(flat: &[T]) -> impl Iterator<Item = [T; 3]> {
    flat.as_chunks().0.iter().copied()
}
