//! `rig --report`: a page that shows what was found in the scan and what the avatar does with it.

use super::{RigFigures, UNSURE, body_joints};
use crate::device_options::DeviceOptions;
use crate::film::write_png;
use crate::size::{Size, Views};
use crate::stills::{RenderSettings, StillRenderer};
use anyhow::Context;
use app_kernels::state::GaussianState;
use app_session::display::Still;
use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, Filter, RendererOptions};
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use scan_rig::finish::Poser;
use scan_rig::pipeline::Rigged;
use scan_rig::scan::Scan;
use spmm3::{GaussianSet, Joint, LOOP_SECONDS, MotionClip, MotionParams, Playback, SH_C0};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Size of a picture of the whole person.
const WHOLE: Size = Size {
    width: 420,
    height: 640,
};

/// Size of a picture of the face.
const FACE: Size = Size {
    width: 360,
    height: 420,
};

/// Vertical field of view, radians.
const FOV: f32 = 0.55;

/// Moments of the built-in motion that are shown, seconds.
const MOMENTS: [f64; 4] = [1.0, 3.5, 6.0, 8.5];

/// Named expressions that are shown, at full strength.
const FACES: [&str; 6] = ["smile", "blink", "brows_up", "a", "o", "e"];

/// A row of the page.
struct Row {
    title: &'static str,
    pictures: Vec<(String, RgbImage)>,
}

/// Writes the pictures and the page `rig.html`, and returns the page's path.
pub(super) fn write(
    folder: &Path,
    figures: &RigFigures,
    rigged: &Rigged,
    device: &DeviceOptions,
) -> anyhow::Result<PathBuf> {
    let rows = [
        registration(rigged, device)?,
        motion(rigged, device)?,
        faces(rigged, device)?,
    ];
    let mut page = String::from(
        "<!doctype html><meta charset=utf-8><title>mon3tr rig</title><style>body{font:15px sans-serif;margin:2em;\
         background:#fafafa}figure{display:inline-block;margin:4px}figcaption{color:#555}td,th{text-align:left;\
         padding:1px 12px 1px 0}.unsure{color:#b00020}</style>",
    );
    let report = &figures.report;
    let _ = write!(
        page,
        "<h1>{}</h1><p>{} Gaussians of {} in the scan, {} vertices, {:.1} MB, {:.0} s</p>",
        escaped(&rigged.avatar.name),
        report.gaussians,
        report.scene_gaussians,
        report.vertices,
        figures.package_bytes as f64 / 1e6,
        figures.seconds
    );
    for warning in &report.warnings {
        let _ = write!(page, "<p class=unsure>{}</p>", escaped(warning));
    }
    for (number, row) in rows.iter().enumerate() {
        let _ = write!(page, "<h2>{}</h2>", row.title);
        for (k, (caption, picture)) in row.pictures.iter().enumerate() {
            let file = format!("{number}-{k}.png");
            write_png(&folder.join(&file), picture)?;
            let _ = write!(
                page,
                "<figure><img src={file}><figcaption>{}</figcaption></figure>",
                escaped(caption)
            );
        }
    }
    page += "<h2>Joints</h2><table><tr><th>joint<th>how sure<th>x, y, z in metres";
    for joint in &report.joints {
        let class = if joint.confidence < UNSURE {
            " class=unsure"
        } else {
            ""
        };
        let [x, y, z] = joint.position;
        let _ = write!(
            page,
            "<tr{class}><td>{}<td>{:.0} %<td>{x:.3}, {y:.3}, {z:.3}",
            joint.name,
            joint.confidence * 100.0
        );
    }
    page += "</table>";
    let file = folder.join("rig.html");
    std::fs::write(&file, page).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}

/// Text of strangers' files within a page.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// The scan, the joints in it, the template over it, and the avatar in its pose.
fn registration(rigged: &Rigged, device: &DeviceOptions) -> anyhow::Result<Row> {
    let gpu = device.gpu()?;
    let poser = Poser::new(&rigged.avatar)?;
    let again = poser.scan(&rigged.scan_motion)?;
    let mesh = poser.vertices(&rigged.scan_motion);
    let most = rigged.scan.len().max(again.len());
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(u32::try_from(most)?, WHOLE.width, WHOLE.height, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options)?;
    let mut draw = |scan: &Scan, camera: &Camera| -> anyhow::Result<RgbImage> {
        renderer.set_foreground(&GaussianState::from(&gaussians(scan)).packed())?;
        renderer.draw(&[*camera])?;
        let rows = renderer.read_back(0)?.over(Backdrop::Colour([0.93; 3]));
        RgbImage::from_raw(WHOLE.width, WHOLE.height, rows).context("a picture of another size")
    };
    let mut pictures = Vec::new();
    for (name, degrees) in [("front", 0.0f32), ("left", 90.0)] {
        let camera = around(degrees.to_radians(), WHOLE);
        let scan = draw(&rigged.scan, &camera)?;
        let mut skeleton = scan.clone();
        for joint in body_joints() {
            let at = |joint: Joint| rigged.joints.get(joint.index()).map(|j| j.as_vec3());
            let ends = (at(joint), joint.parent().and_then(at));
            if let (Some(joint), Some(parent)) = ends {
                line(&mut skeleton, &camera, parent, joint, Rgb([230, 30, 30]));
            }
        }
        let mut template = scan.clone();
        for face in rigged.avatar.template.faces().iter().step_by(2) {
            let [a, b, _] = face.map(|v| mesh.get(v as usize).copied().unwrap_or_default());
            line(&mut template, &camera, a, b, Rgb([30, 120, 230]));
        }
        pictures.push((format!("the scan, {name}"), scan));
        pictures.push(("its joints".to_owned(), skeleton));
        pictures.push(("the template on it".to_owned(), template));
        pictures.push(("the avatar in its pose".to_owned(), draw(&again, &camera)?));
    }
    Ok(Row {
        title: "What was found",
        pictures,
    })
}

/// T-pose and moments of the built-in motion.
fn motion(rigged: &Rigged, device: &DeviceOptions) -> anyhow::Result<Row> {
    let avatar = &rigged.avatar;
    let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, 30.0)?;
    let mut wanted = vec![
        ("T-pose".to_owned(), MotionParams::default(), 0.0),
        ("T-pose, back".to_owned(), MotionParams::default(), 180.0f32),
    ];
    for seconds in MOMENTS {
        let motion = clip.sample(seconds, Playback::Clamp);
        wanted.push((format!("{seconds:.1} s"), motion, 20.0));
    }
    let stills = (wanted.iter())
        .map(|(_, motion, degrees)| Still {
            motion: motion.clone(),
            cameras: vec![around(degrees.to_radians(), WHOLE)],
        })
        .collect();
    let pictures = drawn(rigged, device, WHOLE, stills)?;
    let captions = wanted.into_iter().map(|(caption, ..)| caption);
    Ok(Row {
        title: "The avatar in motion",
        pictures: captions.zip(pictures).collect(),
    })
}

/// Named expressions from near.
fn faces(rigged: &Rigged, device: &DeviceOptions) -> anyhow::Result<Row> {
    let avatar = &rigged.avatar;
    let head = avatar.skeleton.rest_positions()[Joint::Head.index()] + Vec3::Y * 0.05;
    let eye = head + Vec3::new(0.2, 0.03, 0.95);
    let camera = Camera::look_at(eye, head, Vec3::Y, 0.33, FACE.width, FACE.height);
    let mut wanted = vec![("neutral", MotionParams::default())];
    for name in FACES {
        let Some(preset) = avatar.expressions.get(name) else {
            continue;
        };
        let mut motion = MotionParams::default();
        motion
            .expression_mut()
            .copy_from_slice(&preset.coefficients);
        motion.set_axis_angle(Joint::Jaw, Vec3::X * preset.jaw);
        wanted.push((name, motion));
    }
    let stills = (wanted.iter())
        .map(|(_, motion)| Still {
            motion: motion.clone(),
            cameras: vec![camera],
        })
        .collect();
    let pictures = drawn(rigged, device, FACE, stills)?;
    let captions = wanted.into_iter().map(|(name, _)| name.to_owned());
    Ok(Row {
        title: "The face",
        pictures: captions.zip(pictures).collect(),
    })
}

/// The avatar as a viewer sees it.
fn drawn(
    rigged: &Rigged,
    device: &DeviceOptions,
    size: Size,
    stills: Vec<Still>,
) -> anyhow::Result<Vec<RgbImage>> {
    let (gpu, runtime) = (device.gpu()?, device.runtime()?);
    let avatar = Arc::new(rigged.avatar.clone());
    let renderer = StillRenderer {
        gpu: &gpu,
        runtime: &runtime,
        avatar: &avatar,
    };
    let setting = RenderSettings {
        size,
        views: Views::Mono,
        background: None,
        filter: Filter::Dilation,
    };
    let mut pictures = Vec::new();
    renderer.draw(&setting, stills, |_, views| {
        pictures.extend(views);
        Ok(())
    })?;
    Ok(pictures)
}

/// A camera so far around the person, to its left, radians.
fn around(angle: f32, size: Size) -> Camera {
    let target = Vec3::Y * 0.9;
    let eye = target + Vec3::new(angle.sin(), 0.06, angle.cos()) * 3.9;
    Camera::look_at(eye, target, Vec3::Y, FOV, size.width, size.height)
}

/// A scan's Gaussians as a person's.
fn gaussians(scan: &Scan) -> GaussianSet {
    GaussianSet {
        positions: scan.positions.clone(),
        rotations: scan.rotations.clone(),
        log_scales: scan.scales.iter().map(|s| s.map(f32::ln)).collect(),
        opacity_logits: (scan.opacities.iter())
            .map(|o| {
                let o = o.clamp(1e-4, 0.9999);
                (o / (1.0 - o)).ln()
            })
            .collect(),
        colours: scan.colours.iter().map(|c| (*c - 0.5) / SH_C0).collect(),
    }
}

/// Where a camera sees a point, pixels.
fn pixel(camera: &Camera, point: Vec3) -> Option<Vec2> {
    let seen = camera.camera_from_world.transform_point3(point);
    let depth = -seen.z;
    (depth > camera.near).then(|| {
        Vec2::new(
            camera.cx + camera.fx * seen.x / depth,
            camera.cy - camera.fy * seen.y / depth,
        )
    })
}

/// Draws the line between two points.
fn line(picture: &mut RgbImage, camera: &Camera, from: Vec3, to: Vec3, colour: Rgb<u8>) {
    let (Some(from), Some(to)) = (pixel(camera, from), pixel(camera, to)) else {
        return;
    };
    let steps = (to - from).abs().max_element().ceil().clamp(1.0, 2000.0);
    let mut done = 0.0;
    while done <= steps {
        let at = from.lerp(to, done / steps);
        done += 1.0;
        let inside = at.cmpge(Vec2::ZERO).all()
            && at.x < picture.width() as f32
            && at.y < picture.height() as f32;
        if inside {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the picture"
            )]
            picture.put_pixel(at.x as u32, at.y as u32, colour);
        }
    }
}
