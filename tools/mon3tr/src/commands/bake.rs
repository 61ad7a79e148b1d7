//! `mon3tr bake`: builds the demo person's avatar package from MakeHuman's data.

use crate::progress::Bars;
use crate::report::{check_writable, write_json};
use crate::surroundings::{Surroundings, cache, make_folder, makehuman};
use anyhow::Context;
use app::pack;
use glam::Vec3;
use reconstruct::bake::{BAKE_VERSION, BakeOptions, BakeReport, Shot, bake};
use serde::Serialize;
use spmm3::GaussianSet;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xr_renderer::{BackEnd, Camera, Gpu, RenderError, RendererOptions, SplatRenderer};

/// Options of `bake`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    choices: BakeChoices,
    /// The package to write
    #[arg(long, value_name = "FILE", default_value = "out/demo.m3a")]
    out: PathBuf,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a bake may differ in; `demo` takes it too.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct BakeChoices {
    /// Gaussians of the demo avatar, 20k to 400k
    #[arg(long, value_name = "COUNT", default_value = "60k", value_parser = parse_count)]
    gaussians: usize,
}

/// Runs `bake`.
pub(crate) fn run(options: &Options, surroundings: &Surroundings) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let figures = bake_to(&options.choices, &options.out, surroundings)?;
    write_json(options.json.as_deref(), &figures)
}

/// The demo avatar's package from the cache; baked first if there is none of this kind yet.
pub(crate) fn baked_demo_avatar(
    choices: &BakeChoices,
    surroundings: &Surroundings,
) -> anyhow::Result<PathBuf> {
    let file = format!("demo-{}-v{BAKE_VERSION}.m3a", choices.gaussians);
    let package = cache()?.join("avatars").join(file);
    if !package.is_file() {
        println!(
            "baking the demo avatar with {} Gaussians, once: this takes some minutes",
            choices.gaussians
        );
        bake_to(choices, &package, surroundings)?;
    }
    Ok(package)
}

/// Bakes the demo person into the package `out` and prints what was measured.
fn bake_to(
    choices: &BakeChoices,
    out: &Path,
    surroundings: &Surroundings,
) -> anyhow::Result<BakeFigures> {
    let makehuman = makehuman()?;
    if let Some(folder) = out.parent() {
        make_folder(folder)?;
    }
    check_writable(out)?;
    let options = BakeOptions {
        gaussians: choices.gaussians,
        ..BakeOptions::default()
    };
    let easel = match surroundings.gpu() {
        Ok(gpu) => Some(Easel {
            gpu,
            renderer: RefCell::new(None),
        }),
        Err(error) => {
            log::warn!("the bake goes on without measuring pictures: {error:#}");
            None
        }
    };
    let draw = |gaussians: &GaussianSet, shot: &Shot| {
        // A picture that fails costs one figure of the report, not the bake.
        easel
            .as_ref()?
            .draw(gaussians, shot)
            .map_err(|e| log::warn!("cannot draw a held-out pose: {e}"))
            .ok()
    };
    let bars = Bars::default();
    let baked =
        bake(&options, &makehuman, &bars, Some(&draw)).context("cannot bake the demo avatar")?;
    bars.finish();
    let report = baked.report.clone();
    let avatar = baked
        .into_avatar()
        .context("cannot put the avatar together")?;
    let package_bytes = avatar
        .save(out)
        .with_context(|| format!("cannot write {}", out.display()))?;
    let figures = BakeFigures {
        package: out.to_path_buf(),
        package_bytes,
        report,
    };
    figures.print();
    Ok(figures)
}

/// Draws held-out poses for the report, with one renderer for all pictures of a size.
struct Easel {
    gpu: Arc<Gpu>,
    renderer: RefCell<Option<(usize, u32, SplatRenderer)>>,
}

impl Easel {
    fn draw(&self, gaussians: &GaussianSet, shot: &Shot) -> Result<Vec<[f32; 4]>, RenderError> {
        let mut slot = self.renderer.borrow_mut();
        if slot
            .as_ref()
            .is_none_or(|(count, size, _)| (*count, *size) != (gaussians.len(), shot.size))
        {
            let most = u32::try_from(gaussians.len()).unwrap_or(u32::MAX);
            // Few pictures of each size: no use in finding out which back end is faster.
            let options = RendererOptions {
                back_end: Some(BackEnd::Tiles),
                ..RendererOptions::new(most, shot.size, shot.size, 1)
            };
            let renderer = SplatRenderer::new(Arc::clone(&self.gpu), &options)?;
            *slot = Some((gaussians.len(), shot.size, renderer));
        }
        let Some((_, _, renderer)) = slot.as_mut() else {
            return Ok(Vec::new());
        };
        let mut packed = vec![bytemuck::Zeroable::zeroed(); gaussians.len()];
        pack(gaussians, &mut packed);
        let camera = Camera::look_at(
            shot.eye,
            shot.target,
            Vec3::Y,
            shot.fov_y,
            shot.size,
            shot.size,
        );
        renderer.set_foreground(&packed)?;
        renderer.draw(&[camera])?;
        Ok(renderer.read_back(0)?.pixels().to_vec())
    }
}

/// What a bake measured and wrote.
#[derive(Debug, Serialize)]
struct BakeFigures {
    package: PathBuf,
    package_bytes: u64,
    report: BakeReport,
}

impl BakeFigures {
    fn print(&self) {
        let report = &self.report;
        let seconds: f32 = report.steps.iter().map(|s| s.seconds).sum();
        println!(
            "{}: {:.1} MB, baked in {seconds:.0} s",
            self.package.display(),
            self.package_bytes as f64 / 1e6
        );
        println!(
            "{} Gaussians, {} vertices, {} controllers; {} training poses, {} held out",
            report.gaussians,
            report.vertices,
            report.controllers,
            report.training_poses,
            report.held_out_poses
        );
        let held_out = &report.mesh_held_out;
        println!("\nheld-out poses against the simulated truth, mm       mean     p95     max");
        for (what, d) in [
            (
                "hanging cloth, linear blending alone",
                held_out.garment_without,
            ),
            ("hanging cloth, with F_mesh", held_out.garment_with),
            ("every vertex, linear blending alone", held_out.all_without),
            ("every vertex, with F_mesh", held_out.all_with),
        ] {
            println!(
                "{what:<50} {:>7.2} {:>7.2} {:>7.2}",
                d.mean_mm, d.p95_mm, d.max_mm
            );
        }
        let a = &report.attributes_held_out;
        println!("\nheld-out Gaussians, root mean square      without    with F_attr");
        for (what, [without, with]) in [
            ("position, mm", a.position_mm),
            ("log-scale", a.log_scale),
            ("colour, 0..1", a.colour),
        ] {
            println!("{what:<40} {without:>8.3} {with:>10.3}");
        }
        println!(
            "8-bit bases cost {:.4} mm and {:.5} of a colour channel",
            report.quantisation_position_mm, report.quantisation_colour
        );
        match &report.pictures {
            Some(p) => println!(
                "\n{} pictures of held-out poses: {:.1} dB without networks, {:.1} dB with F_mesh, {:.1} dB with F_mesh and F_attr",
                p.pictures, p.without_networks_db, p.with_mesh_db, p.with_both_db
            ),
            None => println!("\npictures of held-out poses: not measured (no Vulkan device)"),
        }
    }
}

fn parse_count(text: &str) -> Result<usize, String> {
    let (digits, unit) = text
        .strip_suffix('k')
        .map_or((text, 1), |digits| (digits, 1000));
    let count = digits
        .parse::<usize>()
        .ok()
        .and_then(|n| n.checked_mul(unit));
    count
        .filter(|n| (20_000..=400_000).contains(n))
        .ok_or_else(|| format!("{text} is not a count from 20k to 400k"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_may_be_written_in_thousands() {
        assert_eq!(parse_count("60k"), Ok(60_000));
        assert_eq!(parse_count("123456"), Ok(123_456));
        for mistake in ["7", "1000k", "many", "99999999999999999999k"] {
            assert!(parse_count(mistake).is_err(), "{mistake}");
        }
    }
}
