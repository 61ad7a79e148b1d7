//! Poses an avatar on the device and on the CPU, compares the pictures and prints how long each pass takes:
//! `cargo run -p mon3tr-tests --example posing_times -- AVATAR.m3a OUT.png`. Milliseconds, least and median of many.
//!
//! OUT.png shows the device's picture between two motion frames, the CPU's, and what differs, 20 times as strong.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use npu_runtime::Runtime;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::{Backdrop, Image};
use renderer_splat::posing::Poser;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::times::StageTimes;
use spmm3::networks::GraphParts;
use spmm3::{
    Avatar, GaussianSet, LOOP_SECONDS, MotionClip, MotionParams, PlanarVertices, Playback, SH_C0,
    SkinningTransforms,
};
use test_support::bound_person::{Networks, avatar_mesh, session};
use test_support::picture_check::{compare, whole};
use test_support::vulkan::open_gpu;

const ROUNDS: usize = 60;
/// The motion's rate, frames per second.
const RATE: f64 = 30.0;
/// Of the loop, seconds, and how far on from there.
const MOMENT: f64 = 2.0;
const SHARE: f32 = 0.4;
const BACKDROP: [f32; 3] = [0.2, 0.22, 0.25];

fn print(what: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let (least, median) = (times[0], times[times.len() / 2]);
    println!("{what}: {least:.2} least, {median:.2} median");
}

/// The whole graph and F_m2g on the CPU.
fn posed_on_cpu(
    runtime: &Runtime,
    avatar: &Avatar,
    motions: &[MotionParams; 2],
) -> Result<[GaussianSet; 2], Box<dyn Error>> {
    let mut whole = session(runtime, avatar, GraphParts::Whole);
    let mut outputs = whole.outputs()?;
    let mut times = Vec::new();
    let mut sets = [0; 2].map(|_| GaussianSet::zeroed(avatar.gaussians.len()));
    for (motion, set) in motions.iter().zip(&mut sets) {
        let mut skinning = SkinningTransforms::default();
        let joints = avatar.skeleton.pose(motion);
        avatar.skeleton.skinning(&joints, &mut skinning);
        whole.input_mut(0).copy_from_slice(motion.values());
        whole.input_mut(1).copy_from_slice(&skinning.0);
        whole.run(&mut outputs)?;
        let posed = PlanarVertices::new(outputs.get(0), avatar.template.vertices().len())?;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            let (residuals, root) = (Some(outputs.get(1)), motion.root_translation);
            avatar.gaussians.pose(posed, residuals, root, set)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    print("CPU, F_m2g with residuals at hand", times);
    Ok(sets)
}

fn between([from, to]: &[GaussianSet; 2], share: f32) -> Vec<PackedGaussian> {
    let opacity = |logit: f32| 1.0 / (1.0 + (-logit).exp());
    (0..from.len())
        .map(|i| {
            let scale = from.log_scales[i].lerp(to.log_scales[i], share);
            let faded = [from, to].map(|set| opacity(set.opacity_logits[i]));
            let colour = from.colours[i].lerp(to.colours[i], share) * SH_C0 + 0.5;
            PackedGaussian::new(
                from.positions[i].lerp(to.positions[i], share).to_array(),
                from.rotations[i].slerp(to.rotations[i], share).to_array(),
                (scale * std::f32::consts::LOG2_E).to_array(),
                faded[0] + (faded[1] - faded[0]) * share,
                colour.to_array(),
            )
        })
        .collect()
}

fn side_by_side(got: &Image, want: &Image, path: &Path) -> Result<(), Box<dyn Error>> {
    let (width, height) = (got.width(), got.height());
    let [got, want] = [got, want].map(|image| image.over(Backdrop::Colour(BACKDROP)));
    let mut out = image::RgbaImage::new(3 * width, height);
    for (x, y, pixel) in out.enumerate_pixels_mut() {
        let at = 3 * (y * width + x % width) as usize;
        let (got, want) = (&got[at..at + 3], &want[at..at + 3]);
        let shown: [u8; 3] = match x / width {
            0 => got.try_into()?,
            1 => want.try_into()?,
            _ => [0, 1, 2].map(|k| got[k].abs_diff(want[k]).saturating_mul(20)),
        };
        *pixel = image::Rgba([shown[0], shown[1], shown[2], 255]);
    }
    out.save(path)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [package, picture] = arguments.as_slice() else {
        return Err("usage: posing_times AVATAR.m3a OUT.png".into());
    };
    let avatar = Avatar::load(Path::new(package))?;
    let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, RATE)?;
    let motions = [MOMENT, MOMENT + 1.0 / RATE].map(|time| clip.sample(time, Playback::Clamp));
    let (gpu, runtime) = (open_gpu()?, Runtime::open(None)?);
    println!("{}", gpu.info().name);
    let sets = posed_on_cpu(&runtime, &avatar, &motions)?;
    let mut networks = Networks::new(&runtime, &avatar);
    let mesh = avatar_mesh(&avatar);
    println!("{mesh:?}");

    let mut poser = Poser::new(&gpu, &mesh)?;
    let mut last = poser.push_state(&networks.pose(&avatar, &motions[0]))?;
    let (mut push, mut passes) = (Vec::new(), [const { Vec::new() }; 4]);
    for round in 1..ROUNDS {
        let input = networks.pose(&avatar, &motions[round % 2]);
        let start = Instant::now();
        let next = poser.push_state(&input)?;
        push.push(start.elapsed().as_secs_f64() * 1e3);
        poser.interpolate(last, next, SHARE)?;
        let times = poser.times();
        let all = [
            times.upload,
            times.skin,
            times.attributes,
            times.interpolate,
        ];
        for (pass, time) in passes.iter_mut().zip(all) {
            pass.push(time);
        }
        last = next;
    }
    print("host, push_state", push);
    let names = ["upload", "skin", "attributes", "interpolate"];
    for (name, times) in names.into_iter().zip(passes) {
        print(&format!("device, {name}"), times);
    }

    let eye = Vec3::new(0.3, 1.1, 2.9);
    let camera = [Camera::look_at(
        eye,
        Vec3::new(0.0, 0.9, 0.0),
        Vec3::Y,
        0.75,
        768,
        1024,
    )];
    let options = RendererOptions {
        mesh: Some(Arc::new(mesh)),
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(u32::try_from(sets[0].len())?, 768, 1024, 1)
    };
    let mut renderer = SplatRenderer::new(gpu, &options)?;
    let from = renderer.push_state(&networks.pose(&avatar, &motions[0]))?;
    let to = renderer.push_state(&networks.pose(&avatar, &motions[1]))?;
    let foreground = Foreground::Posed {
        from,
        to,
        share: SHARE,
        level: 0,
    };
    renderer.draw_with(&Drawing::new(&camera, &[Part::here(foreground)]))?;
    let got = renderer.read_back(0)?;
    renderer.set_foreground(&between(&sets, SHARE))?;
    renderer.draw(&camera)?;
    let want = renderer.read_back(0)?;
    let (psnr, most) = compare(&got, &want, whole(&want));
    println!("device against CPU: {psnr:.1} dB, {most:.4} at most");
    side_by_side(&got, &want, Path::new(picture))?;

    // As in a call: a new pose for every second picture.
    let mut last = to;
    let (mut posed, mut uploaded) = (Vec::new(), Vec::new());
    let set = between(&sets, SHARE);
    for round in 0..ROUNDS {
        let input = networks.pose(&avatar, &motions[round % 2]);
        let next = renderer.push_state(&input)?;
        for share in [0.3, 0.8] {
            let foreground = Foreground::Posed {
                from: last,
                to: next,
                share,
                level: 0,
            };
            renderer.draw_with(&Drawing::new(&camera, &[Part::here(foreground)]))?;
            posed.push(renderer.stage_times());
        }
        last = next;
        renderer.set_foreground(&set)?;
        renderer.draw(&camera)?;
        uploaded.push(renderer.stage_times());
    }
    let of =
        |times: &[StageTimes], stage: fn(&StageTimes) -> f64| times.iter().map(stage).collect();
    print("posed picture, interpolate", of(&posed, |t| t.interpolate));
    print("posed picture, all stages", of(&posed, StageTimes::total));
    print("uploaded picture, upload", of(&uploaded, |t| t.upload));
    print(
        "uploaded picture, all stages",
        of(&uploaded, StageTimes::total),
    );
    Ok(())
}
