//! Draws the demo person with fewer and fewer Gaussians, left out in several orders, and scores the pictures against the
//! full ones: `cargo run -p mon3tr --example importance -- PACKAGE.m3a [OUT_FOLDER [growth]]`; with `growth` other ways
//! to grow those kept instead of other orders.
//!
//! The figures behind the order that `mon3tr bake` stores and the growth of those kept; not a test.

use anyhow::Context;
use app_kernels::state::{GaussianState, plane};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::plan::Plan;
use glam::Vec3;
use npu_runtime::Runtime;
use reconstruct::bake::{Weights, importance};
use renderer_splat::camera::Camera;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::picture::{Backdrop, Image};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;
use spmm3::networks::GraphParts;
use spmm3::{Avatar, BoundGaussians, Importance, MotionClip, Playback, attribute};
use std::path::Path;

const SHARES: [f32; 3] = [0.75, 0.5, 0.35];

/// Name, eye, target, vertical field of view in degrees, size in pixels.
type View = (&'static str, [f32; 3], [f32; 3], f32, u32);

const VIEWS: [View; 4] = [
    ("body", [1.2, 1.25, 3.9], [0.0, 0.92, 0.0], 28.0, 1024),
    ("back", [-1.2, 1.25, -3.9], [0.0, 0.92, 0.0], 28.0, 768),
    ("waist-up", [0.35, 1.45, 1.9], [0.0, 1.32, 0.0], 28.0, 768),
    ("face", [0.22, 1.62, 0.85], [0.0, 1.6, 0.05], 24.0, 768),
];

struct Order {
    name: String,
    importance: Importance,
}

/// How those kept grow.
#[derive(Clone, Copy, Debug)]
enum Growth {
    /// As the receiver does it.
    Level,
    /// All alike: (1 / share) to this power.
    Alike(f32),
    /// Each by the area of those it stands for, to this power.
    Each(f32),
}

fn main() -> anyhow::Result<()> {
    env_logger::init();
    let mut arguments = std::env::args().skip(1);
    let package = arguments.next().context("give an avatar package")?;
    let out = arguments.next();
    let full_scan = arguments.next().is_some();
    let avatar = std::sync::Arc::new(Avatar::load(Path::new(&package))?);
    let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, 20.0, 30.0)?;
    let runtime = Runtime::open(None)?;
    let provider = npu_runtime::Provider::Cpu {
        threads: std::thread::available_parallelism()?.get(),
    };
    let plan = Plan::CpuTail;
    let inference = Inference::open(
        &runtime,
        &avatar,
        GraphParts::Skinned,
        &[provider],
        &CompiledSources::default(),
    )?;
    let mut deformer = Deformer::new(&avatar, inference, plan)?;
    let mut profile = app_pipeline::profile::Profile::default();
    let states: Vec<GaussianState> = [2.0, 9.0]
        .iter()
        .map(|t| {
            let motion = clip.sample(*t, Playback::Clamp);
            Ok(deformer.deform(&motion, &mut profile)?.clone())
        })
        .collect::<anyhow::Result<_>>()?;
    let choice: GpuChoice = std::env::var("MON3TR_GPU").unwrap_or_default().parse()?;
    let gpu = Gpu::open(&choice, false)?;
    let count = u32::try_from(avatar.gaussians.len())?;
    let mut studios = VIEWS
        .iter()
        .map(|(_, _, _, _, size)| {
            let options = RendererOptions {
                back_end: Some(renderer_splat::options::BackEnd::Tiles),
                filter: Filter::Dilation,
                ..RendererOptions::new(count, *size, *size, 1)
            };
            Ok(SplatRenderer::new(gpu.clone(), &options)?)
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let mut draw = |state: &GaussianState, view: usize, kept: &[u32], growth: &[f32]| {
        let (_, eye, target, fov, size) = VIEWS[view];
        let packed: Vec<PackedGaussian> = kept
            .iter()
            .zip(growth)
            .map(|(i, grow)| pack(state, *i as usize, *grow))
            .collect();
        let camera = Camera::look_at(
            eye.into(),
            target.into(),
            Vec3::Y,
            fov.to_radians(),
            size,
            size,
        );
        studios[view].set_foreground(&packed)?;
        studios[view].draw(&[camera])?;
        anyhow::Ok(studios[view].read_back(0)?)
    };
    let all: Vec<u32> = (0..count).collect();
    let none = vec![0.0; all.len()];
    let mut full = Vec::new();
    for state in &states {
        for view in 0..VIEWS.len() {
            full.push(draw(state, view, &all, &none)?);
        }
    }
    if let Some(out) = &out {
        std::fs::create_dir_all(out)?;
        for (view, picture) in full.iter().take(VIEWS.len()).enumerate() {
            write(picture, &format!("{out}/{}-100.png", VIEWS[view].0))?;
        }
    }

    let orders = orders(&avatar, full_scan)?;
    let growths: &[Growth] = if full_scan {
        &[
            Growth::Level,
            Growth::Alike(0.0),
            Growth::Alike(0.25),
            Growth::Alike(0.5),
            Growth::Each(0.35),
            Growth::Each(0.5),
        ]
    } else {
        &[Growth::Level]
    };
    println!(
        "{:<22} {:>6} {:<12} PSNR dB / SSIM: body, back, waist-up, face",
        "order", "share", "growth"
    );
    for order in &orders {
        for share in SHARES {
            let level = order.importance.level(&avatar.gaussians, share);
            let mut best: Option<(f64, String)> = None;
            for growth in growths {
                let factors = match (growth, order.importance.heirs()) {
                    (Growth::Level, _) => level.log2_growth.clone(),
                    (Growth::Alike(power), _) => vec![-power * share.log2(); level.kept.len()],
                    (Growth::Each(power), Some(heirs)) => {
                        each(&avatar.gaussians, &level.kept, heirs, *power)
                    }
                    (Growth::Each(_), None) => continue,
                };
                let mut line = format!("{:<22} {share:>6} {growth:<12?}", order.name);
                let mut sum = 0.0;
                for (view, (name, ..)) in VIEWS.iter().enumerate() {
                    let (mut db, mut ssim_sum) = (0.0, 0.0);
                    for (k, state) in states.iter().enumerate() {
                        let picture = draw(state, view, &level.kept, &factors)?;
                        let (p, s) = score(&full[k * VIEWS.len() + view], &picture);
                        db += p / states.len() as f64;
                        ssim_sum += s / states.len() as f64;
                        if let (Some(out), 0) = (&out, k) {
                            let percent = share * 100.0;
                            write(
                                &picture,
                                &format!("{out}/{name}-{percent}-{}-{growth:?}.png", order.name),
                            )?;
                        }
                    }
                    sum += db;
                    line += &format!("  {db:5.2}/{ssim_sum:.4}");
                }
                if full_scan {
                    println!("{line}");
                } else if best.as_ref().is_none_or(|(b, _)| *b < sum) {
                    best = Some((sum, line));
                }
            }
            if let Some((_, line)) = best {
                println!("{line}");
            }
        }
    }
    Ok(())
}

fn orders(avatar: &Avatar, few: bool) -> anyhow::Result<Vec<Order>> {
    let gaussians = &avatar.gaussians;
    let count = gaussians.len();
    let mut out = Vec::new();
    let mut plain = |name: &str, order: Vec<u32>| -> anyhow::Result<()> {
        out.push(Order {
            name: name.into(),
            importance: Importance::new(order, None, count)?,
        });
        Ok(())
    };
    if !few {
        let mut random: Vec<u32> = (0..u32::try_from(count)?).collect();
        fastrand::Rng::with_seed(1).shuffle(&mut random);
        plain("random", random)?;
        plain(
            "opacity-area",
            Importance::by_size(gaussians).order().to_vec(),
        )?;
        plain("area-contrast", by_contrast(avatar)?)?;
    }
    let stored = Weights::default();
    let candidates: Vec<(String, Weights)> = if few {
        vec![("thinned".into(), stored)]
    } else {
        let mut all = vec![("thinned".to_owned(), stored)];
        for (area, place, normal) in [
            (0.0, 1e-4, 0.02),
            (1.0, 1e-4, 0.02),
            (0.5, 2e-3, 0.02),
            (0.5, 1e-4, 0.2),
        ] {
            let weights = Weights {
                area,
                place,
                normal,
            };
            all.push((format!("thinned-a{area}-p{place}-n{normal}"), weights));
        }
        all
    };
    for (name, weights) in candidates {
        let started = std::time::Instant::now();
        let importance = importance(&avatar.template, gaussians, weights)?;
        log::info!("{name}: {:?}", started.elapsed());
        out.push(Order { name, importance });
    }
    Ok(out)
}

/// Area times the spread of colours around: a simple rule that knows of redundancy, but not of what has gone already.
fn by_contrast(avatar: &Avatar) -> anyhow::Result<Vec<u32>> {
    let gaussians = &avatar.gaussians;
    let count = gaussians.len();
    let colour = |i: usize| {
        Vec3::from_array(std::array::from_fn(|c| {
            gaussians.attributes()[(attribute::COLOUR.start + c) * count + i]
        }))
    };
    // Gaussians of one triangle and its edges' neighbours, by vertex.
    let mut at_vertex = vec![Vec::new(); avatar.template.vertices().len()];
    for (i, corners) in gaussians.corners().iter().enumerate() {
        for corner in corners {
            at_vertex[*corner as usize].push(i);
        }
    }
    let size = Importance::by_size(gaussians);
    let mut rank = vec![0.0f32; count];
    for (k, i) in size.order().iter().enumerate() {
        rank[*i as usize] = 1.0 - k as f32 / count as f32;
    }
    let weights: Vec<f32> = (0..count)
        .map(|i| {
            let mut sum = 0.0;
            let mut n = 0.0f32;
            for corner in gaussians.corners()[i] {
                for j in &at_vertex[corner as usize] {
                    sum += colour(i).distance_squared(colour(*j));
                    n += 1.0;
                }
            }
            (sum / n.max(1.0) + 1e-4) * (rank[i] + 0.05)
        })
        .collect();
    let mut order: Vec<u32> = (0..u32::try_from(count)?).collect();
    order.sort_by(|a, b| weights[*b as usize].total_cmp(&weights[*a as usize]));
    Ok(order)
}

/// log2 of each kept one's growth, by the area it stands for.
fn each(gaussians: &BoundGaussians, kept: &[u32], heirs: &[u32], power: f32) -> Vec<f32> {
    let count = gaussians.len();
    let area = |i: usize| {
        let logs = attribute::LOG_SCALE.map(|p| gaussians.attributes()[p * count + i]);
        let (sum, least) = logs.fold((0.0, f32::INFINITY), |(s, l), v| (s + v, l.min(v)));
        (sum - least).exp()
    };
    let mut is_kept = vec![false; count];
    for i in kept {
        is_kept[*i as usize] = true;
    }
    let mut sum = vec![0.0f32; count];
    for i in 0..count {
        let mut at = i;
        while !is_kept[at] && heirs[at] as usize != at {
            at = heirs[at] as usize;
        }
        sum[at] += area(i);
    }
    kept.iter()
        .map(|i| {
            power
                * (sum[*i as usize] / area(*i as usize))
                    .log2()
                    .clamp(0.0, 4.0)
        })
        .collect()
}

fn pack(state: &GaussianState, i: usize, log2_growth: f32) -> PackedGaussian {
    let at = |plane: usize| state.plane(plane)[i];
    PackedGaussian::new(
        std::array::from_fn(|k| at(plane::POSITION.start + k)),
        std::array::from_fn(|k| at(plane::ROTATION.start + k)),
        std::array::from_fn(|k| at(plane::LOG2_SCALE.start + k) + log2_growth),
        at(plane::OPACITY),
        std::array::from_fn(|k| at(plane::COLOUR.start + k)),
    )
}

const BACKDROP: Backdrop = Backdrop::Colour([0.32, 0.36, 0.42]);

fn write(picture: &Image, file: &str) -> anyhow::Result<()> {
    let rgb = picture.over(BACKDROP);
    image::RgbImage::from_raw(picture.width(), picture.height(), rgb)
        .context("a picture of another size")?
        .save(file)?;
    Ok(())
}

/// PSNR and SSIM (mean over 8 x 8 windows of luma, every 4 pixels) within the box around the person.
fn score(full: &Image, other: &Image) -> (f64, f64) {
    let (width, height) = (full.width() as usize, full.height() as usize);
    let (a, b) = (full.over(BACKDROP), other.over(BACKDROP));
    let (mut left, mut right, mut top, mut bottom) = (width, 0, height, 0);
    for (at, p) in full.pixels().iter().enumerate() {
        if p[3] > 0.02 {
            let (x, y) = (at % width, at / width);
            (left, right) = (left.min(x), right.max(x));
            (top, bottom) = (top.min(y), bottom.max(y));
        }
    }
    let mut square = 0.0;
    let mut n = 0.0f64;
    for y in top..=bottom {
        for x in left..=right {
            for c in 0..3 {
                let at = (y * width + x) * 3 + c;
                square += ((f64::from(a[at]) - f64::from(b[at])) / 255.0).powi(2);
                n += 1.0;
            }
        }
    }
    let luma = |p: &[u8], x: usize, y: usize| {
        let at = (y * width + x) * 3;
        0.299 * f64::from(p[at]) + 0.587 * f64::from(p[at + 1]) + 0.114 * f64::from(p[at + 2])
    };
    let (mut ssim, mut windows) = (0.0, 0.0);
    for y in (top..bottom.saturating_sub(8)).step_by(4) {
        for x in (left..right.saturating_sub(8)).step_by(4) {
            let (mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for dy in 0..8 {
                for dx in 0..8 {
                    let (p, q) = (luma(&a, x + dx, y + dy), luma(&b, x + dx, y + dy));
                    sa += p;
                    sb += q;
                    saa += p * p;
                    sbb += q * q;
                    sab += p * q;
                }
            }
            let (ma, mb) = (sa / 64.0, sb / 64.0);
            let (va, vb, cov) = (
                saa / 64.0 - ma * ma,
                sbb / 64.0 - mb * mb,
                sab / 64.0 - ma * mb,
            );
            let (c1, c2) = (6.5025, 58.5225);
            ssim += (2.0 * ma * mb + c1) * (2.0 * cov + c2)
                / ((ma * ma + mb * mb + c1) * (va + vb + c2));
            windows += 1.0;
        }
    }
    (
        -10.0 * (square / n.max(1.0)).max(1e-12).log10(),
        ssim / f64::max(windows, 1.0),
    )
}
