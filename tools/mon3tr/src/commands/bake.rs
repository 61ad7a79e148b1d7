//! `mon3tr bake`: builds the demo person's avatar package from MakeHuman's data, and compiles a package's deform graph for
//! a headset's NPU.

use crate::device_options::{DeviceOptions, cache, make_folder, makehuman};
use crate::keys;
use crate::progress::Bars;
use crate::report::{check_writable, write_json};
use crate::stills::load_avatar;
use anyhow::{Context, bail};
use app_kernels::state::GaussianState;
use glam::Vec3;
use npu_runtime::{ProviderKind, QnnTarget, Runtime};
use reconstruct::bake::{
    BAKE_VERSION, BakeOptions, BakeReport, PictureReport, Shot, StepTime, bake,
};
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use spmm3::networks::CompiledGraph;
use spmm3::{Avatar, GaussianSet};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Options of `bake`.
#[derive(Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    choices: BakeChoices,
    /// Also compile the deform graph for this NPU (sxr2230p: the Quest 3's). The package is for headsets with it: it keeps the
    /// plain graph too, but is three times as large; send one without to all other devices. ./run fetches the compiler
    #[arg(long, value_name = "TARGET")]
    qnn: Option<QnnTarget>,
    /// With --qnn: take this package's avatar instead of baking the demo person
    #[arg(
        long,
        value_name = "FILE",
        requires = "qnn",
        conflicts_with = "gaussians"
    )]
    avatar: Option<PathBuf>,
    /// The package to write
    #[arg(long, value_name = "FILE", default_value = "out/demo.m3a")]
    out: PathBuf,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a bake may differ in; `demo` takes it too.
#[derive(Debug, Clone, clap::Args)]
pub struct BakeChoices {
    /// Gaussians of the demo avatar, 20k to 400k
    #[arg(long, value_name = "COUNT", default_value = "60k", value_parser = parse_count)]
    gaussians: usize,
}

/// Runs `bake`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    // Its absence is to be known before minutes of baking.
    let npu = options
        .qnn
        .map(|target| Npu::find(target, device))
        .transpose()?;
    let out = &options.out;
    let figures = match (&options.avatar, &npu) {
        (Some(package), Some(npu)) => {
            let (avatar, _) = load_avatar(package)?;
            // No other thread has it yet.
            let mut avatar = Arc::unwrap_or_clone(avatar);
            keys::leave_out_foreign_code(&mut avatar)?;
            let compiled = npu.compile(&mut avatar)?;
            Written::Compiled(Compilation {
                package: out.clone(),
                package_bytes: save(&avatar, out)?,
                compiled,
            })
        }
        _ => {
            let figures = bake_to(&options.choices, npu.as_ref(), out, device)?;
            figures.print();
            Written::Baked(Box::new(figures))
        }
    };
    write_json(options.json.as_deref(), &figures)
}

/// The compiler for an NPU, found.
struct Npu {
    target: QnnTarget,
    runtime: Runtime,
}

impl Npu {
    fn find(target: QnnTarget, device: &DeviceOptions) -> anyhow::Result<Self> {
        let runtime = device.runtime()?;
        let found = runtime.probe();
        let lacking = found
            .into_iter()
            .find(|one| one.provider == ProviderKind::Qnn)
            .and_then(|one| one.lacking);
        if let Some(why) = lacking {
            bail!("cannot compile for {target} without QNN: {why}");
        }
        Ok(Self { target, runtime })
    }

    /// Puts the compiled graph into `avatar`, in the place of one for the same target.
    fn compile(&self, avatar: &mut Avatar) -> anyhow::Result<CompiledFigures> {
        let Self { target, runtime } = self;
        println!("compiling the deform graph for {target}: this takes some seconds");
        let started = Instant::now();
        let onnx = npu_runtime::compile(runtime, &avatar.deform_graph, *target)
            .with_context(|| format!("cannot compile the deform graph for {target}"))?;
        let figures = CompiledFigures {
            target: *target,
            bytes: onnx.len(),
            seconds: started.elapsed().as_secs_f64(),
        };
        println!(
            "compiled for {target}: {:.1} MB in {:.1} s",
            onnx.len() as f64 / 1e6,
            figures.seconds
        );
        avatar
            .compiled
            .retain(|graph| graph.target != target.name());
        avatar.compiled.push(CompiledGraph {
            target: target.name().to_owned(),
            onnx_runtime: runtime.version().to_owned(),
            onnx,
        });
        Ok(figures)
    }
}

/// Writes the package, signed if it was this user's or nobody's and brings compiled graphs, which nobody takes of a package without a signature; gives its
/// size in bytes.
fn save(avatar: &Avatar, out: &Path) -> anyhow::Result<u64> {
    if let Some(folder) = out.parent() {
        make_folder(folder)?;
    }
    let written = if avatar.signer.is_none() && avatar.compiled.is_empty() {
        avatar.save(out)
    } else {
        let keyring = keys::open()?;
        let own = keyring.identity();
        if avatar.signer.is_none_or(|signer| own.public() == signer) {
            println!(
                "{} is signed by {}",
                out.display(),
                own.public().fingerprint()
            );
            avatar.save_signed(out, own)
        } else {
            println!(
                "{} is not signed any more, since its signer is someone else: nobody will use its compiled graph",
                out.display()
            );
            avatar.save(out)
        }
    };
    written.with_context(|| format!("cannot write {}", out.display()))
}

/// The package that was chosen, or the demo avatar's.
pub fn chosen_or_demo_avatar(
    chosen: Option<&Path>,
    choices: &BakeChoices,
    device: &DeviceOptions,
) -> anyhow::Result<PathBuf> {
    match chosen {
        Some(package) => Ok(package.to_owned()),
        None => baked_demo_avatar(choices, device),
    }
}

/// The demo avatar's package from the cache; baked first if there is none of this kind yet.
pub(crate) fn baked_demo_avatar(
    choices: &BakeChoices,
    device: &DeviceOptions,
) -> anyhow::Result<PathBuf> {
    let file = format!("demo-{}-v{BAKE_VERSION}.m3a", choices.gaussians);
    let package = cache()?.join("avatars").join(file);
    if !package.is_file() {
        println!(
            "baking the demo avatar with {} Gaussians, once: one to three minutes",
            choices.gaussians
        );
        bake_to(choices, None, &package, device)?;
    }
    Ok(package)
}

/// Bakes the demo person into the package `out`, compiled for `npu` too if there is one.
fn bake_to(
    choices: &BakeChoices,
    npu: Option<&Npu>,
    out: &Path,
    device: &DeviceOptions,
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
    let easel = match device.gpu() {
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
    let measured = Measured {
        report: baked.report.clone(),
        pictures: baked.pictures,
        steps: baked.steps.clone(),
    };
    let mut avatar = baked
        .into_avatar()
        .context("cannot put the avatar together")?;
    let compiled = npu.map(|npu| npu.compile(&mut avatar)).transpose()?;
    let package_bytes = save(&avatar, out)?;
    Ok(BakeFigures {
        package: out.to_path_buf(),
        package_bytes,
        measured,
        compiled,
    })
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
        let packed = GaussianState::from(gaussians).packed();
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
    #[serde(flatten)]
    measured: Measured,
    #[serde(skip_serializing_if = "Option::is_none")]
    compiled: Option<CompiledFigures>,
}

/// What a bake measured.
#[derive(Debug, Serialize)]
struct Measured {
    /// Also in the package.
    report: BakeReport,
    pictures: Option<PictureReport>,
    steps: Vec<StepTime>,
}

/// What compiling took and gave.
#[derive(Debug, Serialize)]
struct CompiledFigures {
    target: QnnTarget,
    bytes: usize,
    seconds: f64,
}

/// What compiling another avatar's graph wrote.
#[derive(Debug, Serialize)]
struct Compilation {
    package: PathBuf,
    package_bytes: u64,
    compiled: CompiledFigures,
}

/// What a call of `bake` wrote.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Written {
    Baked(Box<BakeFigures>),
    Compiled(Compilation),
}

impl BakeFigures {
    fn print(&self) {
        let Measured {
            report,
            pictures,
            steps,
        } = &self.measured;
        let seconds: f32 = steps.iter().map(|s| s.seconds).sum();
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
        match pictures {
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
