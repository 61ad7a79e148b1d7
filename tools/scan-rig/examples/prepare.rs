//! Prepares a scan and prints what was measured; with `--out FOLDER`, writes pictures of it there with the landmarks drawn in.
//! `--turn X,Y,Z` turns the scan first (degrees about x, then y, then z), `--height METRES`, `--box X0,Y0,Z0,X1,Y1,Z1`.
//!
//! `./run env` prints the environment that it needs.
//!
//! `cargo run --release -p scan-rig --example prepare -- scan.ply --out /tmp/prepared`

use glam::{DVec3, EulerRot, Quat, Vec3};
use image::{Rgb as Pixel, RgbImage};
use renderer_vulkan::choice::GpuChoice;
use scan_rig::pinhole::Pinhole;
use scan_rig::points::KeyPoint;
use scan_rig::prepare::face_points::{close_ups, head_of};
use scan_rig::prepare::landmarks::NAMES;
use scan_rig::prepare::{Networks, Options, prepare};
use scan_rig::sight::Sight;
use splat_scene::{Placement, Scene};
use std::error::Error;
use std::path::PathBuf;

fn numbers(text: &str) -> Result<Vec<f32>, std::num::ParseFloatError> {
    text.split(',').map(str::parse).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut file, mut out, mut turn) = (None, None, Quat::IDENTITY);
    let mut options = Options::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value()?)),
            "--height" => options.height = Some(value()?.parse()?),
            "--turn" => {
                let [x, y, z] = numbers(&value()?)?[..] else {
                    return Err("--turn needs three numbers".into());
                };
                let [x, y, z] = [x, y, z].map(f32::to_radians);
                turn = Quat::from_euler(EulerRot::ZYX, z, y, x);
            }
            "--box" => {
                let [a, b, c, d, e, f] = numbers(&value()?)?[..] else {
                    return Err("--box needs six numbers".into());
                };
                options.within = Some([[a, b, c], [d, e, f]]);
            }
            _ => file = Some(PathBuf::from(argument)),
        }
    }
    let mut scene = Scene::load(&file.ok_or("which file?")?)?;
    scene.place(&Placement::new(1.0, turn, Vec3::ZERO)?);
    let mut sight = Sight::open(&GpuChoice::Auto)?;
    let mut networks = Networks::open(None)?;
    let prepared = prepare(&scene, &options, &mut sight, &mut networks)?;
    let figures = &prepared.figures;
    for up in &figures.candidates {
        println!("up {:.2}: score {:.2}", up.up, up.score);
    }
    println!(
        "{} Gaussians of {}, {} planes taken off, tilt {:.1} degrees, {} views, exchanged in {}, several people in {}, {:.1} % beside the bones",
        figures.gaussians,
        scene.len(),
        figures.planes,
        figures.tilt_degrees,
        figures.views,
        figures.exchanged,
        figures.crowded,
        100.0 * figures.beside
    );
    println!("person from scene: {:?}", prepared.person_from_scene);
    for (name, point) in NAMES.iter().zip(&prepared.body) {
        println!(
            "{name:16} {:7.3} residual {:5.1} mm, support {:.2}",
            point.position,
            1e3 * point.residual,
            point.support
        );
    }
    println!(
        "body: median {:.1} mm of the joints",
        1e3 * figures.body_residual
    );
    if let Some(face) = &prepared.face {
        let mut residuals: Vec<f64> = face.iter().map(|point| point.residual).collect();
        residuals.sort_by(f64::total_cmp);
        println!(
            "face: residual median {:.2} mm, 90 % below {:.2} mm",
            1e3 * residuals[residuals.len() / 2],
            1e3 * residuals[residuals.len() * 9 / 10]
        );
        println!("face looks {:.3?}", head_of(face).map(|head| head.front));
    } else {
        println!("face: none");
    }
    for doubt in &figures.doubts {
        println!("doubt: {doubt}");
    }
    for step in &figures.steps {
        println!("{}: {:.2} s", step.step, step.seconds);
    }
    let Some(out) = out else { return Ok(()) };
    std::fs::create_dir_all(&out)?;
    sight.set(&prepared.scan);
    let middle = DVec3::new(0.0, 0.5 * prepared.height, 0.0);
    let views = [0.0_f64, 90.0, 180.0].map(|degrees| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let eye = middle + DVec3::new(sin, 0.0, cos) * 3.4;
        Pinhole::look_at(eye, middle, DVec3::Y, 1400.0, 640, 900)
    });
    for (index, view) in views.iter().enumerate() {
        let picture = dotted(&mut sight, view, &prepared.body, 2)?;
        picture.save(out.join(format!("body{index}.png")))?;
    }
    if let Some(face) = &prepared.face
        && let Some(head) = head_of(face)
    {
        for (index, view) in close_ups(&head).iter().enumerate() {
            let picture = dotted(&mut sight, view, &face[..], 1)?;
            picture.save(out.join(format!("face{index}.png")))?;
        }
    }
    Ok(())
}

/// The scan with points.
fn dotted(
    sight: &mut Sight,
    view: &Pinhole,
    points: &[KeyPoint],
    radius: i64,
) -> Result<RgbImage, Box<dyn Error>> {
    let seen = sight.picture(view, [0.75; 3])?;
    let mut picture = RgbImage::from_raw(seen.width, seen.height, seen.bytes).ok_or("a picture")?;
    for (index, point) in points.iter().enumerate() {
        let Some(pixel) = view.project(point.position) else {
            continue;
        };
        let colour = if index % 2 == 1 {
            [0, 255, 0]
        } else {
            [255, 0, 0]
        };
        #[expect(clippy::cast_possible_truncation, reason = "within a picture")]
        let (x, y) = (pixel.x as i64, pixel.y as i64);
        for row in y - radius..=y + radius {
            for column in x - radius..=x + radius {
                let at = (u32::try_from(column).ok(), u32::try_from(row).ok());
                if let (Some(column), Some(row)) = at
                    && let Some(place) = picture.get_pixel_mut_checked(column, row)
                {
                    *place = Pixel(colour);
                }
            }
        }
    }
    Ok(picture)
}
