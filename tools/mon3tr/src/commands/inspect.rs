//! `mon3tr inspect`: what is in an avatar package or a Gaussian scene, after every check that drawing it would make.

use crate::report::write_json;
use crate::scenery::{Scenery, check_file, is_scene};
use crate::stills::load_avatar;
use crate::up::UpChoice;
use anyhow::Context;
use glam::Vec3;
use profile_report::AvatarFigures;
use serde::Serialize;
use spmm3::package::Manifest;
use std::path::PathBuf;

/// Options of `inspect`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Avatar package (.m3a), or Gaussian scene (.ply, .splat, .spz, .sog); the content tells which
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The axis of a scene's file that points up, as for `render`
    #[arg(long, value_name = "AXIS", default_value_t = UpChoice::Auto, allow_hyphen_values = true)]
    up: UpChoice,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What `inspect` tells.
#[derive(Debug, Serialize)]
struct Inspection {
    figures: AvatarFigures,
    /// Corners of the template's bounding box, metres.
    bounds_metres: [[f32; 3]; 2],
    /// Whether the package says which Gaussians to leave out first; without, the smaller and more transparent ones go.
    importance_in_package: bool,
    manifest: Manifest,
}

/// Runs `inspect`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    // Of a missing package its reader says how to come by one.
    let ending = options.file.extension().unwrap_or_default();
    if !ending.eq_ignore_ascii_case("m3a") {
        check_file(&options.file)?;
    }
    if is_scene(&options.file) {
        let scenery = Scenery::alone(&options.file, options.up, None)?;
        let figures = scenery.figures;
        figures.print();
        return write_json(options.json.as_deref(), &figures);
    }
    let (avatar, figures) = load_avatar(&options.file)?;
    let manifest = Manifest::load(&options.file)
        .with_context(|| format!("cannot read {}", options.file.display()))?;
    let vertices = avatar.template.vertices();
    let low = vertices
        .iter()
        .copied()
        .reduce(Vec3::min)
        .unwrap_or_default();
    let high = vertices
        .iter()
        .copied()
        .reduce(Vec3::max)
        .unwrap_or_default();
    let inspection = Inspection {
        figures,
        bounds_metres: [low.to_array(), high.to_array()],
        importance_in_package: avatar.importance.is_some(),
        manifest,
    };
    inspection.print();
    write_json(options.json.as_deref(), &inspection)
}

impl Inspection {
    fn print(&self) {
        let (figures, manifest) = (&self.figures, &self.manifest);
        let [low, high] = self.bounds_metres;
        println!(
            "{} ({}, format version {})",
            manifest.name, manifest.format, manifest.version
        );
        println!("package      {} bytes", figures.package_bytes);
        println!("Gaussians    {}", figures.gaussians);
        let importance = if self.importance_in_package {
            "which to leave out first is in the package"
        } else {
            "no order in the package: small and transparent ones are left out first"
        };
        println!("importance   {importance}");
        println!("vertices     {}", figures.vertices);
        println!("triangles    {}", figures.triangles);
        println!("controllers  {}", figures.controllers);
        if let Some(bases) = manifest.counts.bases {
            println!("bases        {bases}");
        }
        println!(
            "T-pose       {:.2} m wide, {:.2} m high, {:.2} m deep",
            high[0] - low[0],
            high[1] - low[1],
            high[2] - low[2]
        );
        let expressions: Vec<&str> = manifest.expressions.keys().map(String::as_str).collect();
        println!(
            "expressions  {} (basis {})",
            expressions.join(", "),
            manifest.basis()
        );
        if manifest.pose_range.is_some() {
            println!("pose range   stated: what networks see of a motion is clamped to it");
        }
        for graph in &manifest.compiled {
            println!(
                "compiled     for {} by QNN {} and ONNX Runtime {}",
                graph.target, graph.qnn, graph.onnx_runtime
            );
        }
        let signer = manifest.signer.map(|signer| signer.fingerprint());
        let signer = signer.as_deref().unwrap_or("nobody: anyone may drive it");
        println!("signed by    {signer}");
        println!("from         {}", manifest.provenance);
        println!("licence      {}", manifest.licence);
        println!("\n{:<24} {:>10}  sha256", "member", "bytes");
        for member in &manifest.members {
            let digest = member.sha256.get(..16).unwrap_or(&member.sha256);
            println!("{:<24} {:>10}  {digest}...", member.name, member.bytes);
            for (name, tensor) in &member.tensors {
                println!("  {name:<22} {:>10}  {:?}", tensor.dtype, tensor.shape);
            }
        }
    }
}
