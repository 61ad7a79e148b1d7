//! Looks at the body model's own head with the network that looks at scans, and prints where each landmark of the face is on the model: the table in
//! `src/body/face_vertices.rs`. With `--out FOLDER`, writes the pictures there with the landmarks drawn in.
//!
//! `./run env` prints the environment that it needs.
//!
//! `cargo run --release -p scan-rig --example face_vertices > tools/scan-rig/src/body/face_vertices.rs`

use glam::{DVec3, Quat, Vec2, Vec3};
use image::{Rgb as Pixel, RgbImage};
use reconstruct::Texture;
use reconstruct::makehuman::Package;
use renderer_vulkan::choice::GpuChoice;
use scan_rig::body::{BodyModel, BodyPart};
use scan_rig::points::KeyPoint;
use scan_rig::prepare::face_points::close_ups;
use scan_rig::prepare::{Head, Networks, face_landmarks_of};
use scan_rig::scan::Scan;
use scan_rig::sight::Sight;
use spmm3::Joint;
use std::error::Error;
use std::path::PathBuf;

/// Gaussians along each of a quad's edges.
const CELLS: u8 = 5;
/// A landmark farther from every vertex is not on the model, metres.
const REACH: f64 = 0.008;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--out" {
            out = arguments.next().map(PathBuf::from);
        }
    }
    let makehuman = PathBuf::from(
        std::env::var_os("MON3TR_MAKEHUMAN")
            .ok_or("MON3TR_MAKEHUMAN must name the MakeHuman data")?,
    );
    let model = BodyModel::load(&makehuman)?;
    let mut sight = Sight::open(&GpuChoice::Auto)?;
    let mut networks = Networks::open(None)?;
    sight.set(&head(&model, &makehuman)?);
    let eyes = [Joint::LeftEye, Joint::RightEye].map(|eye| model.joints[eye.index()]);
    let head = Head {
        eyes: (eyes[0] + eyes[1]) / 2.0,
        front: DVec3::Z,
        up: DVec3::Y,
    };
    let draw = |view: &_| sight.picture(view, [0.6; 3]);
    let face = face_landmarks_of(draw, &mut networks, &head)?.ok_or("the network saw no face")?;
    let candidates: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && model.head_share(*v) > 0.5)
        .collect();
    let mut found = Vec::new();
    for point in face.iter() {
        let nearest = (candidates.iter().copied())
            .map(|v| (v, point.position - model.rest[v]))
            .min_by(|a, b| a.1.length().total_cmp(&b.1.length()));
        let good = nearest.filter(|(_, offset)| offset.length() < REACH && point.residual < 0.003);
        found.push(good);
    }
    // The last ten are the irises': eyes turn.
    let last = found.len() - 10;
    found[last..].fill(None);
    let mut residuals: Vec<f64> = face.iter().map(|point| 1e3 * point.residual).collect();
    residuals.sort_by(f64::total_cmp);
    let mut offsets: Vec<f64> = found
        .iter()
        .flatten()
        .map(|(_, offset)| 1e3 * offset.length())
        .collect();
    offsets.sort_by(f64::total_cmp);
    eprintln!(
        "rays miss by {:.2} mm (median), {} landmarks on the model, {:.2} mm from their vertices (median)",
        residuals[residuals.len() / 2],
        offsets.len(),
        offsets[offsets.len() / 2]
    );
    println!(
        "//! Where the face mesh's landmarks are on the body model: written by the example `face_vertices`."
    );
    println!();
    println!(
        "/// For each landmark a vertex, and how far the landmark is from it in the model's rest pose, hundredths of a millimetre; nothing where the landmark"
    );
    println!("/// is not on the model.");
    println!("#[rustfmt::skip]");
    println!(
        "pub(super) const FACE_VERTICES: [Option<(u16, [i16; 3])>; {}] = [",
        found.len()
    );
    for row in found.chunks(4) {
        let texts: Vec<String> = row
            .iter()
            .map(|found| {
                found.map_or_else(
                    || "None".to_owned(),
                    |(v, offset)| {
                        let [x, y, z] = (offset * 1e5).round().to_array();
                        format!("Some(({v}, [{x:.0}, {y:.0}, {z:.0}]))")
                            .replace("-0,", "0,")
                            .replace("-0]", "0]")
                    },
                )
            })
            .collect();
        println!("    {},", texts.join(", "));
    }
    println!("];");
    let Some(out) = out else { return Ok(()) };
    std::fs::create_dir_all(&out)?;
    for (index, view) in close_ups(&head).iter().enumerate() {
        let seen = sight.picture(view, [0.6; 3])?;
        let mut picture =
            RgbImage::from_raw(seen.width, seen.height, seen.bytes).ok_or("a picture")?;
        let mut dot = |point: DVec3, colour: [u8; 3]| {
            if let Some(pixel) = view.project(point) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a pixel; negative ones become 0"
                )]
                let at = (pixel.x as u32, pixel.y as u32);
                if let Some(place) = picture.get_pixel_mut_checked(at.0, at.1) {
                    *place = Pixel(colour);
                }
            }
        };
        face.iter()
            .for_each(|point: &KeyPoint| dot(point.position, [0, 255, 0]));
        found
            .iter()
            .flatten()
            .for_each(|(v, _)| dot(model.rest[*v], [255, 0, 0]));
        picture.save(out.join(format!("face{index}.png")))?;
    }
    Ok(())
}

/// The head and neck in Gaussians, as MakeHuman's textures colour them.
fn head(model: &BodyModel, makehuman: &std::path::Path) -> Result<Scan, Box<dyn Error>> {
    let package = Package::new(makehuman);
    let skin = Texture::read(
        &package.data("skins/young_caucasian_male/textures/young_lightskinned_male_diffuse.png"),
    )?;
    let eye = Texture::read(&package.data("proxies/eyes/HighPolyEyes/textures/blue_eye.png"))?;
    let neck = model.joints[Joint::Neck.index()].y - 0.1;
    let mut scan = Scan::default();
    for (quad, part) in model.parts.iter().step_by(2).enumerate() {
        let halves = [model.faces[2 * quad], model.faces[2 * quad + 1]];
        let uvs = [model.uvs[2 * quad], model.uvs[2 * quad + 1]];
        let corners = [halves[0][0], halves[0][1], halves[0][2], halves[1][2]];
        let uvs = [uvs[0][0], uvs[0][1], uvs[0][2], uvs[1][2]];
        let texture = match part {
            BodyPart::Skin | BodyPart::Face | BodyPart::Head => &skin,
            BodyPart::Eyes => &eye,
            _ => continue,
        };
        let places = corners.map(|v| model.rest[v as usize].as_vec3());
        if places.iter().any(|p| f64::from(p.y) < neck) {
            continue;
        }
        let normal = (places[2] - places[0])
            .cross(places[3] - places[1])
            .normalize_or_zero();
        let x = (places[1] - places[0]).normalize_or(normal.any_orthonormal_vector());
        let y = normal.cross(x);
        for i in 0..CELLS {
            for j in 0..CELLS {
                let [s, t] = [i, j].map(|k| (f32::from(k) + 0.5) / f32::from(CELLS));
                let shares = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
                let mix = |values: [Vec3; 4]| -> Vec3 {
                    values.iter().zip(shares).map(|(v, share)| *v * share).sum()
                };
                let uv: Vec2 = uvs.iter().zip(shares).map(|(uv, share)| *uv * share).sum();
                let size = |a: usize, b: usize| places[a].distance(places[b]) / f32::from(CELLS);
                let light = 0.6 + 0.4 * normal.dot(Vec3::new(0.2, 0.5, 0.8)).clamp(-0.3, 1.0);
                scan.positions.push(mix(places));
                scan.rotations
                    .push(Quat::from_mat3(&glam::Mat3::from_cols(x, y, normal)).normalize());
                scan.scales.push(
                    Vec3::new(0.6 * size(0, 1), 0.6 * size(0, 3), 4e-4).max(Vec3::splat(2e-4)),
                );
                scan.opacities.push(0.97);
                scan.colours.push(texture.sample(uv).truncate() * light);
            }
        }
    }
    Ok(scan)
}
