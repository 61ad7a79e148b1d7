//! Registers the body model to scans and prints how well: files, and synthetic people by their numbers (0 to 7), whose joints are known.
//!
//! `./run env` prints the environment that it needs.
//!
//! `cargo run --release -p scan-rig --example registration -- scan.ply 0 1 2 3 4 5 6 7`

use glam::DVec3;
use reconstruct::BareBody;
use renderer_vulkan::choice::GpuChoice;
use scan_rig::body::{BodyModel, Observed, error_of, register};
use scan_rig::prepare::{Networks, Options, prepare};
use scan_rig::sight::Sight;
use scan_rig::surface::survey;
use scan_rig::synthetic::{ScanOptions, SyntheticPerson};
use splat_scene::Scene;
use spmm3::{JOINTS, Joint};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

/// SMPL-X's joints without jaw, eyes and fingers.
const BODY: usize = 22;

fn main() -> Result<(), Box<dyn Error>> {
    let makehuman = PathBuf::from(
        std::env::var_os("MON3TR_MAKEHUMAN")
            .ok_or("MON3TR_MAKEHUMAN must name the MakeHuman data")?,
    );
    let model = BodyModel::load(&makehuman)?;
    let mut body = BareBody::open(&makehuman)?;
    let mut sight = Sight::open(&GpuChoice::Auto)?;
    let mut networks = Networks::open(None)?;
    let mut means = Vec::new();
    // Squares of real errors and of those that the confidence stands for, millimetres.
    let (mut real, mut expected) = (0.0, 0.0);
    for argument in std::env::args().skip(1) {
        let (scene, truth) = match argument.parse::<usize>() {
            Ok(number) => {
                let person = SyntheticPerson::new(&mut body, &makehuman, number)?;
                let truth = person.scan(&ScanOptions {
                    gaussians: 100_000,
                    ..ScanOptions::default()
                });
                (truth.scan.to_scene()?, Some(truth))
            }
            Err(_) => (Scene::load(PathBuf::from(&argument).as_path())?, None),
        };
        let prepared = prepare(&scene, &Options::default(), &mut sight, &mut networks)?;
        let surface = survey(&prepared.scan).surface;
        let clock = Instant::now();
        let (registered, report) = register(
            &model,
            &Observed {
                body: &prepared.body,
                face: prepared.face.as_deref(),
                points: &surface.points,
                normals: &surface.normals,
                hints: &[],
            },
        )?;
        println!(
            "{argument}: {:.2} s, surface {:.1} mm (root mean square), displaced {:.2} mm (median), face {}, body's landmarks {:.1} mm, clothes {:.0} mm",
            clock.elapsed().as_secs_f64(),
            1e3 * report.surface,
            1e3 * report.displaced,
            report
                .face
                .map_or_else(|| "none".into(), |face| format!("{:.2} mm", 1e3 * face)),
            1e3 * report.key_points,
            1e3 * report.cloth,
        );
        for warning in &report.warnings {
            println!("  {warning}");
        }
        let unsure = |joint: Joint| registered.confidence[joint.index()];
        let least = Joint::ALL
            .into_iter()
            .take(BODY)
            .min_by(|a, b| unsure(*a).total_cmp(&unsure(*b)));
        if let Some(least) = least {
            println!("  least sure: {} {:.2}", least.name(), unsure(least));
        }
        let Some(truth) = truth else { continue };
        let placed = &prepared.person_from_scene;
        let errors: Vec<f64> = (0..JOINTS)
            .map(|j| 1e3 * registered.joints[j].distance(placed.point(truth.joints[j])))
            .collect();
        for (error, sure) in errors.iter().zip(registered.confidence).take(BODY) {
            real += error * error;
            expected += (1e3 * error_of(sure)).powi(2);
        }
        let front = placed.rotation * DVec3::new(truth.yaw.sin(), 0.0, truth.yaw.cos());
        let turned = registered.rotations[Joint::Pelvis.index()].z_axis;
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = (0..BODY).fold(0, |most, j| if errors[j] > errors[most] { j } else { most });
        println!(
            "  22 joints {:.1} mm off, most {} with {:.1}; fingers {:.1}; the pelvis turned {:.1} degrees too far",
            mean(&errors[..BODY]),
            Joint::ALL[worst].name(),
            errors[worst],
            mean(&errors[25..]),
            front
                .cross(turned)
                .dot(DVec3::Y)
                .atan2(front.dot(turned))
                .to_degrees(),
        );
        means.push((mean(&errors[..BODY]), errors[worst]));
    }
    if !means.is_empty() {
        let mean = means.iter().map(|(mean, _)| mean).sum::<f64>() / means.len() as f64;
        let worst = means.iter().map(|(_, worst)| *worst).fold(0.0, f64::max);
        println!(
            "{} people: 22 joints {mean:.1} mm off on average, {worst:.1} at most; their errors are {:.2} of what the confidence says (root mean square)",
            means.len(),
            f64::sqrt(real / expected)
        );
    }
    Ok(())
}
