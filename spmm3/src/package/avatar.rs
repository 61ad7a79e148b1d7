//! An avatar in memory, and how it is read from a `.m3a` package.

use super::PackageError;
use super::archive::Archive;
use super::compiled::{self, check_entries};
use super::error::GRAPH;
use super::limits::PackageLimits;
use super::manifest::{MANIFEST, Manifest, VERSION};
use super::members::{self, MEMBERS};
use super::signed::{self, SIGNATURE};
use crate::networks::CompiledGraph;
use crate::{
    BoundGaussians, Controllers, ExpressionBasis, Expressions, Importance, KeptLevel, MotionParams,
    PoseRange, Skeleton, Template,
};
use identity::PublicKey;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek};
use std::path::Path;

/// The manifest is parsed into a tree, which takes more memory than its text.
const MAX_MANIFEST: u64 = 1 << 20;

/// A person's avatar: all that a package holds.
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
    /// Which Gaussians to leave out last, where the builder found out; see [`Self::importance`].
    pub importance: Option<Importance>,
    /// Which controllers hold each Gaussian.
    pub controllers: Controllers,
    /// The basis of the 50 expression coefficients: a motion's are turned into it by
    /// [`crate::MotionClip::fit_expression`].
    pub expression_basis: ExpressionBasis,
    /// Named expressions.
    pub expressions: Expressions,
    /// F_mesh, LBS and F_attr as one ONNX graph ([`crate::networks::DeformGraph::to_onnx`]).
    pub deform_graph: Vec<u8>,
    /// What the graph sees of a motion is clamped to this range, where the builder states one: [`PoseRange::clamp`].
    pub pose_range: Option<PoseRange>,
    /// The same graph compiled for chips, if it was.
    pub compiled: Vec<CompiledGraph>,
    /// What the builder measured (errors), free in form.
    pub report: serde_json::Value,
    /// Who signed the package that this was read from; [`Self::save`] writes no signature.
    pub signer: Option<PublicKey>,
}

impl Avatar {
    /// The avatar as a reader of its package sees it: Gaussians rounded to half precision
    /// ([`BoundGaussians::quantised`]). Saving and loading gives exactly this, but for the signer.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        self.gaussians = self.gaussians.quantised();
        self
    }

    /// What the networks see of a motion, into `seen`: its P (`[215]`), clamped to the poses that they have learnt from, where the builder states them.
    ///
    /// # Panics
    /// If `seen` has another length.
    pub fn networks_see(&self, motion: &MotionParams, seen: &mut [f32]) {
        seen.copy_from_slice(motion.values());
        if let Some(range) = &self.pose_range {
            range.clamp(seen);
        }
    }

    /// Which Gaussians to leave out last: as the package says, else the larger and the less transparent ones.
    #[must_use]
    pub fn importance(&self) -> Importance {
        self.importance
            .clone()
            .unwrap_or_else(|| Importance::by_size(&self.gaussians))
    }

    /// The Gaussians to draw at each of these shares of them (0..=1), by importance. Allocates: once, at the start.
    #[must_use]
    pub fn kept_levels(&self, shares: &[f32]) -> Vec<KeptLevel> {
        let importance = self.importance();
        let level = |share: &f32| importance.level(&self.gaussians, *share);
        shares.iter().map(level).collect()
    }

    /// Reads the package at `path`.
    ///
    /// # Errors
    /// If the file cannot be read, or anything in it is not as the manifest says; nothing of it is used then. [`PackageError::Cost`] if those who look at the
    /// person could not draw them in time.
    pub fn load(path: &Path) -> Result<Self, PackageError> {
        Self::load_within(path, &PackageLimits::OWN)
    }

    /// As [`Self::load`], of a package that may be so large.
    ///
    /// # Errors
    /// [`PackageError::TooLarge`] before anything is unpacked; or as [`Self::load`].
    pub fn load_within(path: &Path, limits: &PackageLimits) -> Result<Self, PackageError> {
        Self::read_within(open(path)?, limits)
    }

    /// Reads a package.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn read(reader: impl Read + Seek) -> Result<Self, PackageError> {
        Self::read_within(reader, &PackageLimits::OWN)
    }

    /// As [`Self::load_within`].
    ///
    /// # Errors
    /// As there.
    pub fn read_within(
        reader: impl Read + Seek,
        limits: &PackageLimits,
    ) -> Result<Self, PackageError> {
        let mut archive = Archive::open(reader)?;
        let manifest = Manifest::from_archive(&mut archive)?;
        manifest.check_within(limits)?;
        let expression_basis = manifest.basis();
        let expressions = manifest.presets()?;
        let pose_range = manifest.range()?;
        let (skeleton, template) = members::unpack_template(&mut archive, &manifest)?;
        let (gaussians, importance) =
            members::unpack_gaussians(&mut archive, &manifest, &template)?;
        gaussians.check_cost().map_err(PackageError::Cost)?;
        let controllers = members::unpack_controllers(&mut archive, &manifest, &template)?;
        let deform_graph = members::unpack_graph(&mut archive, &manifest, &template, &controllers)?;
        let compiled = if manifest.compiled.is_empty() {
            Vec::new()
        } else {
            let signature = members::signature(&deform_graph)?;
            compiled::unpack(&mut archive, &manifest, &signature)?
        };
        Ok(Self {
            name: manifest.name,
            provenance: manifest.provenance,
            licence: manifest.licence,
            skeleton,
            template,
            gaussians,
            importance,
            controllers,
            expression_basis,
            expressions,
            deform_graph,
            pose_range,
            compiled,
            report: manifest.report,
            signer: manifest.signer,
        })
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

    /// Refuses what is larger than the limits. What members really hold is at most what the manifest says of each, or they are refused.
    fn check_within(&self, limits: &PackageLimits) -> Result<(), PackageError> {
        let graph = self.member(GRAPH).map_or(0, |member| member.bytes);
        let all = (self.members.iter()).fold(0u64, |sum, member| sum.saturating_add(member.bytes));
        let gaussians = self.counts.gaussians as u64;
        for (what, has, limit) in [
            ("Gaussians", gaussians, limits.gaussians as u64),
            ("bytes of networks", graph, limits.graph_bytes),
            ("bytes", all, limits.bytes),
        ] {
            if has > limit {
                return Err(PackageError::TooLarge { what, has, limit });
            }
        }
        Ok(())
    }

    /// Reads the manifest and checks that the archive holds what it lists and nothing else.
    fn from_archive<R: Read + Seek>(archive: &mut Archive<R>) -> Result<Self, PackageError> {
        let text = archive.unpack(MANIFEST, MAX_MANIFEST)?;
        let mut manifest = Self::parse(&text)?;
        manifest.signer = signed::signer(archive, &text)?;
        if manifest.signer.is_none() && manifest.version >= VERSION {
            return Err(PackageError::member(SIGNATURE, "it is missing"));
        }
        let mut listed: Vec<&str> = manifest.members.iter().map(|m| m.name.as_str()).collect();
        listed.push(MANIFEST);
        let signature = manifest.signer.map(|_| SIGNATURE);
        listed.extend(signature);
        listed.sort_unstable();
        let mut present = archive.names();
        present.sort_unstable();
        if present != listed {
            return Err(PackageError::archive(format!(
                "it holds {present:?}, but its manifest lists {listed:?}"
            )));
        }
        let entries: Vec<_> = manifest.compiled.iter().collect();
        check_entries(&entries).map_err(|e| PackageError::member(MANIFEST, e))?;
        let compiled = manifest.compiled.iter().map(|entry| entry.member.as_str());
        let mut known: Vec<&str> = MEMBERS
            .into_iter()
            .chain([MANIFEST])
            .chain(signature)
            .chain(compiled)
            .collect();
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
    // Some systems open folders and fail later, with words about something else.
    if path.is_dir() {
        return Err(PackageError::Folder);
    }
    File::open(path)
        .map(BufReader::new)
        .map_err(|source| match source.kind() {
            ErrorKind::NotFound => PackageError::Missing,
            _ => PackageError::File {
                action: "open",
                path: path.to_path_buf(),
                source,
            },
        })
}
