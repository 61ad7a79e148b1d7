//! Makes the first avatar of a capture and draws its template from several sides, shaded by its normals and in its Gaussians' colours:
//! `cargo run --release -p person-template --example first_avatar -- OUT [CAPTURE]`. Without a capture, one is made up. MON3TR_MAKEHUMAN names MakeHuman's data.

#[path = "../tests/made_up/mod.rs"]
mod made_up;

use anyhow::{Context, Result};
use capture::{Camera, Capture};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use image::{Rgb, RgbImage};
use person_template::raster::draw;
use person_template::{First, TemplateOptions, first_avatar};
use scan_rig::body::BodyModel;
use spmm3::{Joint, SH_C0};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Sides of the pictures, pixels.
const SIDE: u32 = 900;

/// How far away the pictures' cameras stand, metres.
const AWAY: f64 = 4.0;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let out = arguments.next().context("name a folder for the pictures")?;
    std::fs::create_dir_all(&out)?;
    let makehuman = std::env::var_os("MON3TR_MAKEHUMAN").map(PathBuf::from);
    let makehuman = makehuman.context("MON3TR_MAKEHUMAN must name the MakeHuman data")?;
    let made = tempfile::tempdir()?;
    let (folder, truth) = match arguments.next() {
        Some(folder) => (folder, None),
        None => {
            let scenario = made_up::Scenario {
                cameras: 8,
                frames: 16,
                side: 384,
                noise: (0.006, 0.02),
            };
            let model = BodyModel::load(&makehuman)?;
            let truth =
                made_up::write(made.path(), &model, scenario, &capture::HeldOut::default())?;
            (made.path().to_owned(), Some(truth))
        }
    };
    let capture = Capture::open(&folder)?;
    let options = TemplateOptions {
        frames: 12,
        ..TemplateOptions::default()
    };
    let clock = Instant::now();
    let told = |what: &'static str| println!("{:6.1} s: {what}", clock.elapsed().as_secs_f64());
    let first = first_avatar(&capture, &makehuman, &options, &told)?;
    println!(
        "{:6.1} s: done\n{:#?}",
        clock.elapsed().as_secs_f64(),
        first.report
    );
    if let Some(truth) = truth {
        print_joints(&first, &truth);
    }
    first.avatar.save(&out.join("first.m3a"))?;
    pictures(&first, &out)
}

fn print_joints(first: &First, truth: &made_up::Truth) {
    for (name, fitted) in [("fitted frames", true), ("other frames", false)] {
        let (mut sum, mut count) = (0.0, 0.0);
        for (frame, motion) in first.poses.iter().enumerate() {
            if first.report.frames.contains(&frame) != fitted {
                continue;
            }
            let posed = first.avatar.skeleton.pose(motion);
            for joint in Joint::ALL.into_iter().take(Joint::Jaw.index()) {
                let place = (posed.position(joint) + motion.root_translation).as_dvec3();
                sum += place.distance(truth.joints[frame][joint.index()]);
                count += 1.0;
            }
        }
        println!(
            "joints in {name}: {:.1} mm",
            1e3 * sum / f64::max(count, 1.0)
        );
    }
}

fn pictures(first: &First, out: &Path) -> Result<()> {
    let joint = |joint: Joint| first.avatar.skeleton.rest_positions()[joint.index()].as_dvec3();
    let middle = DVec3::new(0.0, 0.5 * first.report.height, 0.0);
    let (head, hand) = (joint(Joint::Head), joint(Joint::LeftMiddle1));
    let face = head + DVec3::Y * 0.06;
    for (name, target, way, width) in [
        ("front", middle, DVec3::Z, 2.1),
        ("back", middle, DVec3::NEG_Z, 2.1),
        ("side", middle, DVec3::new(1.0, 0.0, 0.25), 2.1),
        ("below", middle, DVec3::new(0.4, -0.3, 1.0), 1.6),
        ("face", face, DVec3::Z, 0.36),
        ("profile", face, DVec3::X, 0.4),
        ("hand", hand, DVec3::new(0.1, 1.0, 0.15), 0.3),
        (
            "shoulder",
            joint(Joint::LeftShoulder),
            DVec3::new(0.2, 0.3, 1.0),
            0.6,
        ),
    ] {
        let camera = look_at(target + way.normalize() * AWAY, target, width);
        for (kind, coloured) in [("normals", false), ("colours", true)] {
            let path = out.join(format!("{name}-{kind}.png"));
            picture(first, &camera, coloured).save(&path)?;
        }
    }
    Ok(())
}

/// A camera that sees `width` metres.
fn look_at(eye: DVec3, target: DVec3, width: f64) -> Camera {
    let away = (target - eye).normalize();
    let right = away.cross(DVec3::Y).normalize();
    let rotation = DMat3::from_cols(right, away.cross(right), away).transpose();
    Camera {
        name: "look".to_owned(),
        size: [SIDE; 2],
        focal: [AWAY * f64::from(SIDE) / width; 2],
        centre: [0.5 * f64::from(SIDE); 2],
        distortion: [0.0; 5],
        camera_from_world: DAffine3 {
            matrix3: rotation,
            translation: -(rotation * eye),
        },
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "display values"
)]
fn picture(first: &First, camera: &Camera, coloured: bool) -> RgbImage {
    let template = &first.avatar.template;
    let vertices: Vec<DVec3> = template.vertices().iter().map(|v| v.as_dvec3()).collect();
    let drawn = draw(camera, &vertices, template.faces());
    let colours = face_colours(first);
    let mut picture = RgbImage::from_pixel(SIDE, SIDE, Rgb([255; 3]));
    for (pixel, face) in picture.pixels_mut().zip(&drawn.face) {
        let Some(corners) = template.faces().get(*face as usize) else {
            continue;
        };
        let [a, b, c] = corners.map(|v| vertices[v as usize]);
        let normal = camera.camera_from_world.matrix3 * (b - a).cross(c - a).normalize_or_zero();
        let light = normal.dot(DVec3::new(-0.3, -0.5, -0.8).normalize());
        let grey = Vec3::splat((0.25 + 0.7 * light.max(0.0)) as f32);
        // What is seen from its back is red: there should be none.
        let shade = if normal.z > 0.05 { Vec3::X } else { grey };
        let shown = if coloured {
            colours[*face as usize]
        } else {
            shade
        };
        *pixel = Rgb((shown * 255.0).to_array().map(|value| value.round() as u8));
    }
    picture
}

/// The mean colour of the Gaussians on each face; white where there is none.
fn face_colours(first: &First) -> Vec<Vec3> {
    let gaussians = &first.avatar.gaussians;
    let (count, planes) = (gaussians.len(), gaussians.attributes());
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); first.avatar.template.faces().len()];
    for (at, face) in gaussians.triangles().iter().enumerate() {
        let channel = |k: usize| 0.5 + SH_C0 * planes[(11 + k) * count + at];
        let sum = &mut sums[*face as usize];
        *sum = (
            sum.0 + Vec3::new(channel(0), channel(1), channel(2)),
            sum.1 + 1.0,
        );
    }
    (sums.into_iter())
        .map(|(sum, count)| if count > 0.0 { sum / count } else { Vec3::ONE })
        .collect()
}
