//! `mon3tr-dev eval avatar`: an avatar against the photographs of a capture, as the paper's tables have it (section V): training poses, novel
//! poses and novel views, by PSNR, SSIM, and LPIPS and FID where networks are given; also with parts of the avatar switched off.

mod ablation;
mod canvas;
mod colours;
mod compare;
mod draw;
mod frechet;
mod groups;
mod networks;
mod pages;
mod psnr;
mod ssim;
mod table;
#[cfg(test)]
mod tests;

use ablation::{Ablation, Part};
use anyhow::{Context, ensure};
use capture::Capture;
use colours::Colours;
use compare::{Means, Pair, Scores};
use groups::Group;
use mon3tr::device_options::{DeviceOptions, describe};
use mon3tr::progress::bar;
use mon3tr::report::{check_writable, write_json};
use mon3tr::stills::{StillRenderer, load_avatar};
use networks::{Features, Lpips};
use pages::Pages;
use spmm3::MotionParams;
use std::path::PathBuf;
use std::sync::Arc;
use table::{Report, Row};

/// Pairs that the page shows of each group and method.
const SHOWN: usize = 6;

/// Options of `eval avatar`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// The capture's folder; it must have masks and motion
    #[arg(value_name = "CAPTURE")]
    capture: PathBuf,
    /// The avatar's package
    #[arg(value_name = "PACKAGE")]
    package: PathBuf,
    /// Pictures of each group at most, spread evenly over cameras and frames
    #[arg(long, value_name = "N", default_value = "60")]
    pictures: usize,
    /// Also measure the avatar without a part; may be given several times: each alone, then all that are switched off together
    #[arg(long, value_name = "PART")]
    without: Vec<Part>,
    /// Also measure the avatar with each Gaussian following its strongest controller alone
    #[arg(long)]
    nearest_controller: bool,
    /// Correct the colours of what is drawn by a matrix for each camera, fitted to some of its pictures of frames that are trained on: for real cameras
    #[arg(long)]
    colour_correction: bool,
    /// LPIPS as ONNX: two pictures [1, 3, height, width] of values -1 to 1 in, one number out
    #[arg(long, value_name = "FILE.onnx")]
    lpips: Option<PathBuf>,
    /// Inception's features as ONNX: a picture [1, 3, height, width] of values 0 to 1 in, its features out
    #[arg(long, value_name = "FILE.onnx")]
    fid: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the tables as Markdown
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write a page of picture pairs with error maps into this folder
    #[arg(long, value_name = "FOLDER")]
    pages: Option<PathBuf>,
}

/// What judges pictures besides arithmetic.
#[derive(Debug)]
struct Judges {
    lpips: Option<Lpips>,
    features: Option<Features>,
}

pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    for file in [&options.json, &options.markdown].into_iter().flatten() {
        check_writable(file)?;
    }
    ensure!(options.pictures > 0, "--pictures must be at least 1");
    let capture = Capture::open(&options.capture).context("cannot use the capture")?;
    let (avatar, _) = load_avatar(&options.package)?;
    let runtime = device.runtime()?;
    let gpu = device.gpu()?;
    let open = |path: &Option<PathBuf>| path.clone();
    let mut judges = Judges {
        lpips: (open(&options.lpips).map(|path| Lpips::open(&path, &runtime))).transpose()?,
        features: (open(&options.fid).map(|path| Features::open(&path, &runtime))).transpose()?,
    };
    let groups = groups::groups(
        capture.cameras().len(),
        capture.frames(),
        capture.held_out(),
        options.pictures,
    );
    let ablation = Ablation {
        without: options.without.clone(),
        nearest_controller: options.nearest_controller,
    };
    let methods = ablation.rows();
    let mut pages = options.pages.as_deref().map(Pages::new).transpose()?;
    let motions = draw::motions(&capture, &avatar)?;
    let colours = if options.colour_correction {
        let renderer = StillRenderer {
            gpu: &gpu,
            runtime: &runtime,
            avatar: &avatar,
        };
        Colours::fitted(&renderer, &capture, &motions)?
    } else {
        Colours::default()
    };
    let mut rows = Vec::new();
    for method in methods {
        let name = method.name();
        let ablated = Arc::new(method.of((*avatar).clone())?);
        let renderer = StillRenderer {
            gpu: &gpu,
            runtime: &runtime,
            avatar: &ablated,
        };
        let mut means = Vec::new();
        for group in &groups {
            means.push(measure(
                &renderer,
                &capture,
                &motions,
                &colours,
                group,
                &mut judges,
                |k, pair, scores| {
                    let shown = group.pictures.len().div_ceil(SHOWN).max(1);
                    let (camera, frame) = group.pictures[k];
                    let camera = &capture.cameras()[camera].name;
                    match &mut pages {
                        Some(pages) if k % shown == 0 => {
                            pages.add(group.name, &name, camera, frame, pair, scores)
                        }
                        _ => Ok(()),
                    }
                },
            )?);
        }
        rows.push(Row {
            method: name,
            groups: means,
        });
    }
    let report = Report {
        capture: options.capture.display().to_string(),
        package: options.package.display().to_string(),
        gaussians: avatar.gaussians.len(),
        device: describe(&gpu),
        colour_correction: options.colour_correction,
        groups: groups.iter().map(|group| group.name).collect(),
        rows,
    };
    print!("{}", report.markdown());
    if let Some(path) = &options.markdown {
        std::fs::write(path, report.markdown())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(pages) = &pages {
        pages.finish(&report)?;
    }
    write_json(options.json.as_deref(), &report)
}

/// Draws a group's pictures and compares each with its photograph; `compared` gets each with its index in the group.
fn measure(
    renderer: &StillRenderer<'_>,
    capture: &Capture,
    motions: &[MotionParams],
    colours: &Colours,
    group: &Group,
    judges: &mut Judges,
    mut compared: impl FnMut(usize, &Pair, &Scores) -> anyhow::Result<()>,
) -> anyhow::Result<Means> {
    let bar = bar(group.name, group.pictures.len());
    let (mut all, mut nobody) = (Vec::new(), 0);
    let (mut of_truth, mut of_drawn) = (Vec::new(), Vec::new());
    draw::draw(renderer, capture, motions, &group.pictures, |k, image| {
        let (camera, frame) = group.pictures[k];
        bar.inc(1);
        let pair = || Pair::new(&capture.photograph(camera, frame)?, image);
        let picture = || format!("camera {}, frame {frame}", capture.cameras()[camera].name);
        let Some(mut pair) = pair().with_context(picture)? else {
            nobody += 1;
            return Ok(());
        };
        colours.apply(camera, &mut pair);
        let mut scores = pair.scores()?;
        let square = pair.square();
        if let Some(lpips) = &mut judges.lpips {
            scores.lpips = Some(lpips.distance(&pair.truth, &pair.drawn, square)?);
        }
        if let Some(features) = &mut judges.features {
            of_truth.push(features.of(&pair.truth, square)?);
            of_drawn.push(features.of(&pair.drawn, square)?);
        }
        compared(k, &pair, &scores)?;
        all.push(scores);
        Ok(())
    })?;
    bar.finish_and_clear();
    if nobody > 0 {
        eprintln!(
            "{}: {nobody} of {} pictures have an empty mask and are left out",
            group.name,
            group.pictures.len()
        );
    }
    Ok(Means::of(&all, [&of_truth, &of_drawn]))
}
