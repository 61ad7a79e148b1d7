//! The package's table of contents, `manifest.json`: what is in the package, how large, and what its numbers mean.
//!
//! Keys this version does not know are ignored, so that a later writer may add notes; a change in meaning raises
//! [`VERSION`].

use super::PackageError;
use super::error::is_unprintable;
use crate::{
    EXPRESSION, ExpressionBasis, ExpressionPreset, Expressions, JOINTS, PARAMS, PersonError,
    PoseRange,
};
use identity::PublicKey;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the format in [`Manifest::format`].
pub const FORMAT: &str = "mon3tr-avatar";
/// Newest format version this crate reads: that of a package with a signature.
pub const VERSION: u32 = 3;
/// The version of a package with a compiled graph or an order of importance, and of one with neither: what older programs read too.
pub(super) const VERSION_EXTENDED: u32 = 2;
pub(super) const VERSION_PLAIN: u32 = 1;

/// How [`Manifest::generator`] begins in packages that this crate writes; the version follows.
pub(super) const GENERATOR: &str = "mon3tr ";

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
    /// The basis of the expression coefficients; [`Self::basis`] also knows that of packages without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expression_basis: Option<ExpressionBasis>,
    /// Named expressions.
    #[serde(default)]
    pub expressions: BTreeMap<String, ExpressionEntry>,
    /// Where the networks have learnt: what the graph sees of a motion is clamped to it. Programs older than it leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_range: Option<PoseRangeEntry>,
    /// What the builder measured (errors), free in form.
    #[serde(default)]
    pub report: serde_json::Value,
    /// Whose package it is, by a signature that fits: of a member of its own, which the manifest does not list.
    #[serde(skip)]
    pub signer: Option<PublicKey>,
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

/// A [`PoseRange`]: 165 values each, radians, in the order body | hands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseRangeEntry {
    /// The least rotations.
    pub low: Vec<f32>,
    /// The greatest.
    pub high: Vec<f32>,
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

    /// The basis of the expression coefficients. A package that names none is older than the names: if this project's baker
    /// wrote it, its face is MakeHuman's; if another program did, the 50 slots are SMPL-X's, which are FLAME's.
    #[must_use]
    pub fn basis(&self) -> ExpressionBasis {
        self.expression_basis.clone().unwrap_or({
            if self.generator.starts_with(GENERATOR) {
                ExpressionBasis::MAKEHUMAN_1
            } else {
                ExpressionBasis::FLAME_2020
            }
        })
    }

    /// The range of poses, checked.
    pub(super) fn range(&self) -> Result<Option<PoseRange>, PackageError> {
        let entry = self.pose_range.as_ref();
        entry
            .map(|entry| PoseRange::new(&entry.low, &entry.high))
            .transpose()
            .map_err(PackageError::contents(MANIFEST))
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

impl From<&PoseRange> for PoseRangeEntry {
    fn from(range: &PoseRange) -> Self {
        Self {
            low: range.low().to_vec(),
            high: range.high().to_vec(),
        }
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
            "expression",
            "coefficients of the basis that expression_basis names; a motion's are mapped onto it or left out",
        ),
        (
            "pose_range",
            "the rotations (body 75 | hands 90) that the networks have learnt from: what the graph's motion input gets is \
             clamped to it, joint transforms are not",
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A manifest with these keys beside the needed ones.
    fn parse(extra: &str) -> Result<Manifest, PackageError> {
        let text = format!(
            r#"{{"format": "mon3tr-avatar", "version": 1, "name": "x", "members": [], "counts": {{"vertices": 3, "faces": 1,
                "gaussians": 1, "controllers": 1, "joints": 55, "motion": 215}}{extra}}}"#
        );
        Manifest::parse(text.as_bytes())
    }

    #[test]
    fn the_basis_is_what_the_manifest_names_and_in_older_ones_the_writers_own() {
        let basis = |extra: &str| parse(extra).expect("a good manifest").basis();
        let named = r#", "generator": "mon3tr 0.1.0", "expression_basis": "flame-2020""#;
        assert_eq!(basis(named), ExpressionBasis::FLAME_2020, "named");
        let ours = r#", "generator": "mon3tr 0.1.0""#;
        assert_eq!(basis(ours), ExpressionBasis::MAKEHUMAN_1, "our baker's");
        let others = r#", "generator": "another 2.0""#;
        assert_eq!(basis(others), ExpressionBasis::FLAME_2020, "SMPL-X's");
        assert_eq!(basis(""), ExpressionBasis::FLAME_2020, "no writer named");
    }

    #[test]
    fn a_pose_range_is_read_back_left_out_where_there_is_none_and_refused_where_it_is_broken() {
        let none = parse("").expect("a good manifest");
        assert_eq!(none.range().expect("none"), None, "none stated");
        let text = serde_json::to_string(&none).expect("text");
        assert!(!text.contains(r#""pose_range":"#), "as it was read");
        let range = PoseRange::new(&[-0.25; 165], &[0.5; 165]).expect("in order");
        let entry = serde_json::to_string(&PoseRangeEntry::from(&range)).expect("text");
        let read = |entry: &str| parse(&format!(r#", "pose_range": {entry}"#));
        let stated = read(&entry).expect("a good manifest");
        assert_eq!(stated.range().expect("good"), Some(range), "the same");
        let exchanged = entry.replace("low", "x").replace("high", "low");
        let exchanged = exchanged.replace('x', "high");
        let short = entry.replacen("-0.25,", "", 1);
        for (broken, said) in [(exchanged, "high number 0"), (short, "low has 164")] {
            let refused = read(&broken).expect("it parses").range();
            let refused = refused.expect_err("broken");
            assert!(refused.to_string().contains("manifest.json"), "{refused}");
            let why = std::error::Error::source(&refused).expect("a reason");
            assert!(why.to_string().contains(said), "{why}");
        }
        let refused = read(r#"{"low": [null], "high": []}"#).expect_err("no number");
        assert!(refused.to_string().contains("manifest.json"), "{refused}");
    }

    #[test]
    fn a_basis_is_written_under_its_name_and_one_that_cannot_be_printed_is_refused() {
        let named = parse(r#", "expression_basis": "my-basis.2""#).expect("a good manifest");
        let text = serde_json::to_string(&named).expect("text");
        assert!(
            text.contains(r#""expression_basis":"my-basis.2""#),
            "{text}"
        );
        let error = parse(r#", "expression_basis": "a\nb""#).expect_err("a line break");
        assert!(error.to_string().contains("manifest.json"), "{error}");
        let older = serde_json::to_string(&parse("").expect("good")).expect("text");
        assert!(!older.contains("expression_basis"), "as it was read");
    }
}
