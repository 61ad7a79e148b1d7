//! The package's table of contents, `manifest.json`: what is in the package, how large, and what its numbers mean.
//!
//! Keys this version does not know are ignored, so that a later writer may add notes; a change in meaning raises
//! [`VERSION`].

use super::PackageError;
use super::error::is_unprintable;
use crate::{EXPRESSION, ExpressionPreset, Expressions, JOINTS, PARAMS, PersonError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the format in [`Manifest::format`].
pub const FORMAT: &str = "mon3tr-avatar";
/// Newest format version this crate reads. It came with compiled graphs and the order of importance, and is written where
/// a package has either.
pub const VERSION: u32 = 2;
/// The version of a package with neither, which older programs read too.
pub(super) const VERSION_PLAIN: u32 = 1;

/// Name of the manifest's member.
pub(super) const MANIFEST: &str = "manifest.json";

/// Most Gaussians a package may hold.
pub const MAX_GAUSSIANS: usize = 1_000_000;
/// Most template vertices a package may hold.
pub const MAX_VERTICES: usize = 200_000;
/// Most template triangles a package may hold.
pub const MAX_FACES: usize = 2 * MAX_VERTICES;
/// Most controllers a package may hold: their indices are 16 bits wide.
pub const MAX_CONTROLLERS: usize = 1 << 16;
/// Most named expressions and most bytes of one of their names.
const MAX_EXPRESSIONS: usize = 256;
const MAX_NAME: usize = 256;

/// What `mon3tr inspect` shows of a package, and what a reader checks every member against.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// Format version, at most [`VERSION`].
    pub version: u32,
    /// The avatar's name.
    pub name: String,
    /// The program that wrote the package.
    #[serde(default)]
    pub generator: String,
    /// Where the avatar's data came from.
    #[serde(default)]
    pub provenance: String,
    /// What one may do with the avatar.
    #[serde(default)]
    pub licence: String,
    /// Space, units and orders of the tensors, for readers with other tools.
    #[serde(default)]
    pub conventions: BTreeMap<String, String>,
    /// Sizes that all members agree on.
    pub counts: Counts,
    /// Every other member of the archive, in its order there.
    pub members: Vec<MemberEntry>,
    /// The members that hold the deform graph compiled for a chip's NPU.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compiled: Vec<CompiledEntry>,
    /// Named expressions.
    #[serde(default)]
    pub expressions: BTreeMap<String, ExpressionEntry>,
    /// What the builder measured (errors, times), free in form.
    #[serde(default)]
    pub report: serde_json::Value,
}

/// Sizes that all members agree on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// N_v, template vertices.
    pub vertices: usize,
    /// N_f, template triangles.
    pub faces: usize,
    /// N_g, Gaussians.
    pub gaussians: usize,
    /// C, controllers.
    pub controllers: usize,
    /// B, deformation bases, where the graph stores them in our own form.
    #[serde(default)]
    pub bases: Option<usize>,
    /// Joints of the skeleton: 55.
    pub joints: usize,
    /// Motion parameters: 215.
    pub motion: usize,
}

/// One member of the archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemberEntry {
    /// File name in the archive.
    pub name: String,
    /// Unpacked size.
    pub bytes: u64,
    /// SHA-256 of the unpacked bytes, lower-case hexadecimal.
    pub sha256: String,
    /// The member's tensors by name; for the graph, its inputs and outputs.
    #[serde(default)]
    pub tensors: BTreeMap<String, TensorEntry>,
}

/// One member that holds the deform graph compiled for a chip's NPU.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompiledEntry {
    /// The member's name.
    pub member: String,
    /// The chip.
    pub target: String,
    /// The version of ONNX Runtime that compiled it.
    pub onnx_runtime: String,
    /// The version of QNN that compiled it.
    pub qnn: String,
}

/// Type and shape of one tensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TensorEntry {
    /// Element type as safetensors writes it: `F32`, `F16`, `U32`, `U16`, `U8`.
    pub dtype: String,
    /// Sizes, outermost first.
    pub shape: Vec<usize>,
}

impl TensorEntry {
    /// The entry in words, e.g. `F32 [3, 20]`.
    pub(super) fn describe(&self) -> String {
        format!("{} {:?}", self.dtype, self.shape)
    }
}

/// One named expression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpressionEntry {
    /// The 50 expression coefficients at full strength.
    pub coefficients: Vec<f32>,
    /// Opening of the jaw joint at full strength, radians.
    pub jaw: f32,
}

/// The part of a manifest that every version has, read first.
#[derive(Deserialize)]
struct Header {
    format: String,
    version: u32,
}

impl Manifest {
    /// Parses and checks everything that can be checked without the members.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, PackageError> {
        let broken = |e: serde_json::Error| PackageError::member(MANIFEST, e.to_string());
        let header: Header = serde_json::from_slice(bytes).map_err(broken)?;
        if header.format != FORMAT {
            let reason = format!("the format is {:?}, not {FORMAT:?}", header.format);
            return Err(PackageError::member(MANIFEST, reason));
        }
        if header.version > VERSION {
            return Err(PackageError::Newer {
                found: header.version,
                newest: VERSION,
            });
        }
        let manifest: Self = serde_json::from_slice(bytes).map_err(broken)?;
        manifest.counts.check()?;
        manifest.check_texts()?;
        Ok(manifest)
    }

    /// These texts are printed: one line each, without control characters.
    fn check_texts(&self) -> Result<(), PackageError> {
        let texts = [
            ("name", &self.name),
            ("generator", &self.generator),
            ("provenance", &self.provenance),
            ("licence", &self.licence),
        ];
        let expressions = self.expressions.keys().map(|name| ("expressions", name));
        let compiled = self.compiled.iter().flat_map(|entry| {
            [
                ("compiled graphs", &entry.onnx_runtime),
                ("compiled graphs", &entry.qnn),
            ]
        });
        for (what, text) in texts.into_iter().chain(expressions).chain(compiled) {
            if let Some(c) = text.chars().find(|c| is_unprintable(*c)) {
                let reason = format!(
                    "its {what} holds the character U+{:04X}, which must not be printed",
                    u32::from(c)
                );
                return Err(PackageError::member(MANIFEST, reason));
            }
        }
        Ok(())
    }

    /// The entry of member `name`.
    #[must_use]
    pub fn member(&self, name: &str) -> Option<&MemberEntry> {
        self.members.iter().find(|entry| entry.name == name)
    }

    /// The named expressions, checked.
    pub(super) fn presets(&self) -> Result<Expressions, PackageError> {
        if self.expressions.len() > MAX_EXPRESSIONS {
            let reason = format!("more than {MAX_EXPRESSIONS} expressions");
            return Err(PackageError::member(MANIFEST, reason));
        }
        let preset = |(name, entry): (&String, &ExpressionEntry)| {
            if name.len() > MAX_NAME {
                let reason = format!("an expression's name is longer than {MAX_NAME} bytes");
                return Err(PackageError::member(MANIFEST, reason));
            }
            let wrong = PackageError::contents(MANIFEST);
            let coefficients: [f32; EXPRESSION] = entry.coefficients[..]
                .try_into()
                .map_err(|_| PersonError::Count {
                    what: "coefficients of an expression",
                    got: entry.coefficients.len(),
                    expected: EXPRESSION,
                })
                .map_err(PackageError::contents(MANIFEST))?;
            PersonError::check_range(
                "expression coefficient",
                &coefficients,
                -1000.0,
                1000.0,
                "-1000..1000",
            )
            .and_then(|()| {
                let jaw = [entry.jaw];
                PersonError::check_range("expression's jaw", &jaw, -3.2, 3.2, "-3.2..3.2 rad")
            })
            .map_err(wrong)?;
            let jaw = entry.jaw;
            Ok((name.clone(), ExpressionPreset { coefficients, jaw }))
        };
        self.expressions.iter().map(preset).collect()
    }
}

impl From<&ExpressionPreset> for ExpressionEntry {
    fn from(preset: &ExpressionPreset) -> Self {
        Self {
            coefficients: preset.coefficients.to_vec(),
            jaw: preset.jaw,
        }
    }
}

impl Counts {
    /// Refuses counts beyond the limits, before anything is sized by them.
    fn check(&self) -> Result<(), PackageError> {
        let limits = [
            ("vertices", self.vertices, 1, MAX_VERTICES),
            ("faces", self.faces, 1, MAX_FACES),
            ("gaussians", self.gaussians, 1, MAX_GAUSSIANS),
            ("controllers", self.controllers, 1, MAX_CONTROLLERS),
            ("bases", self.bases.unwrap_or(1), 1, 256),
            ("joints", self.joints, JOINTS, JOINTS),
            ("motion", self.motion, PARAMS, PARAMS),
        ];
        for (what, count, low, high) in limits {
            if !(low..=high).contains(&count) {
                let reason = format!("counts.{what} is {count}, outside {low}..={high}");
                return Err(PackageError::member(MANIFEST, reason));
            }
        }
        Ok(())
    }
}

/// What the tensors mean, for readers without this source.
pub(super) fn conventions() -> BTreeMap<String, String> {
    [
        (
            "space",
            "metres, right-handed, y up, the person faces +z, +x is the person's left, T-pose",
        ),
        (
            "motion",
            "body 75 | expression 50 | hands 90, axis-angle in radians, SMPL-X joint order",
        ),
        (
            "skinning",
            "12 x 55 planes: row 3*column+row of each joint's 3x4 posed-from-rest matrix, root translation left out",
        ),
        (
            "attributes",
            "14 planes: offset 3 (metres), quaternion x y z w, log of the standard deviation 3 (ln metres), opacity \
             logit, colour 3 as SH degree 0 (rgb = 0.5 + 0.28209479 c); offset and quaternion in the triangle's frame",
        ),
        (
            "order",
            "Gaussian indices, the most important first: a viewer that draws fewer draws the first ones",
        ),
        (
            "heirs",
            "for each Gaussian the one that covers its place once it is left out; itself if none does",
        ),
        (
            "triangle frame",
            "columns x along corner 0 -> 1, z along the normal, y = z cross x; the origin is the barycentric anchor",
        ),
        (
            "barycentric",
            "weights of corners 1 and 2; corner 0 has the rest",
        ),
        (
            "masses",
            "virtual masses of the three controllers, normalised to sum 1",
        ),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()))
    .into()
}
