//! `rig --report`: a page that shows what was found in the scan and what the avatar does with it.

use super::{RigFigures, body_joints};
use crate::device_options::DeviceOptions;
use crate::film::write_png;
use crate::size::{Size, Views};
use crate::stills::{RenderSettings, StillRenderer};
use anyhow::Context;
use app_session::display::Still;
use glam::{DVec2, DVec3, Vec3};
use image::{Rgb, RgbImage};
use renderer_splat::camera::Camera;
use renderer_splat::options::Filter;
use scan_rig::body::UNSURE;
use scan_rig::finish::Poser;
use scan_rig::pinhole::Pinhole;
use scan_rig::pipeline::Rigged;
use scan_rig::scan::Scan;
use scan_rig::sight::Sight;
use spmm3::{Avatar, Joint, LOOP_SECONDS, MotionClip, MotionParams, Playback};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Size of a picture of the whole person.
const WHOLE: Size = Size {
    width: 560,
    height: 560,
};

/// Size of a picture of the face.
const FACE: Size = Size {
    width: 360,
    height: 420,
};

/// Focal length of pictures of the whole person, pixels.
const FOCAL: f64 = 1050.0;

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
    let poser = Poser::new(&rigged.avatar)?;
    let again = poser.scan(&rigged.scan_motion)?;
    let mesh = poser.vertices(&rigged.scan_motion);
    let mut sight = Sight::on(device.gpu()?);
    let mut draw = |scan: &Scan, view: &Pinhole| -> anyhow::Result<RgbImage> {
        sight.set(scan);
        let picture = sight.picture(view, [0.93; 3])?;
        RgbImage::from_raw(picture.width, picture.height, picture.bytes)
            .context("a picture of another size")
    };
    let mut pictures = Vec::new();
    for (name, degrees) in [("front", 0.0), ("left", 90.0)] {
        let view = around(&rigged.avatar, degrees);
        let scan = draw(&rigged.scan, &view)?;
        let mut skeleton = scan.clone();
        for joint in body_joints() {
            let at = |joint: Joint| rigged.joints[joint.index()];
            if let Some(parent) = joint.parent() {
                let ends = [at(parent), at(joint)];
                line(&mut skeleton, &view, ends, Rgb([230, 30, 30]), 1.0);
            }
        }
        let mut template = scan.clone();
        for face in rigged.avatar.template.faces().iter().step_by(2) {
            let corner = |v: u32| mesh.get(v as usize).copied().unwrap_or_default().as_dvec3();
            let [a, b, _] = face.map(corner);
            line(&mut template, &view, [a, b], Rgb([30, 120, 230]), 0.25);
        }
        pictures.push((format!("the scan, {name}"), scan));
        pictures.push(("its joints".to_owned(), skeleton));
        pictures.push(("the template on it".to_owned(), template));
        pictures.push(("the avatar in its pose".to_owned(), draw(&again, &view)?));
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
        ("T-pose, back".to_owned(), MotionParams::default(), 180.0),
    ];
    for seconds in MOMENTS {
        let motion = clip.sample(seconds, Playback::Clamp);
        wanted.push((format!("{seconds:.1} s"), motion, 20.0));
    }
    let stills = (wanted.iter())
        .map(|(_, motion, degrees)| Still {
            motion: motion.clone(),
            cameras: vec![around(avatar, *degrees).camera()],
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

/// All of the person from so many degrees to its left.
fn around(avatar: &Avatar, degrees: f64) -> Pinhole {
    let angle = degrees.to_radians();
    let heights = avatar.template.vertices().iter().map(|v| v.y);
    let height = f64::from(heights.fold(0.0, f32::max));
    let target = DVec3::Y * (0.5 * height);
    let eye = target + DVec3::new(angle.sin(), 0.06, angle.cos()) * (2.17 * height);
    Pinhole::look_at(eye, target, DVec3::Y, FOCAL, WHOLE.width, WHOLE.height)
}

/// Draws the line between two points, so opaque: 0..=1.
fn line(
    picture: &mut RgbImage,
    view: &Pinhole,
    [from, to]: [DVec3; 2],
    colour: Rgb<u8>,
    opacity: f32,
) {
    let (Some(from), Some(to)) = (view.project(from), view.project(to)) else {
        return;
    };
    let steps = (to - from).abs().max_element().ceil().clamp(1.0, 2000.0);
    let mut done = 0.0;
    while done <= steps {
        let at = from.lerp(to, done / steps);
        done += 1.0;
        let size = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
        if at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all() {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the picture"
            )]
            let pixel = picture.get_pixel_mut(at.x as u32, at.y as u32);
            for (old, new) in pixel.0.iter_mut().zip(colour.0) {
                let mixed = f32::from(*old) + opacity * (f32::from(new) - f32::from(*old));
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "between two bytes"
                )]
                let mixed = mixed.round() as u8;
                *old = mixed;
            }
        }
    }
}
