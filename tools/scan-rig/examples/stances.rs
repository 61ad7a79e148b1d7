//! How well people who do not exist are stood upright: synthetic scans turned and tilted, and the error of up, facing and joints.
//!
//! `cargo run --release -p scan-rig --example stances -- [--people 4] [--turns 4] [--room]`; `./run env` prints the environment.

use glam::{DVec3, EulerRot, Quat, Vec3};
use reconstruct::BareBody;
use renderer_vulkan::choice::GpuChoice;
use scan_rig::prepare::landmarks::JOINTS;
use scan_rig::prepare::{Networks, Options, prepare};
use scan_rig::sight::Sight;
use scan_rig::synthetic::{ScanOptions, Surroundings, SyntheticPerson};
use spmm3::Joint;
use std::error::Error;
use std::f32::consts::FRAC_PI_2;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut people, mut turns, mut surroundings) = (4, 4, Surroundings::None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--people" => people = arguments.next().ok_or("how many?")?.parse()?,
            "--turns" => turns = arguments.next().ok_or("how many?")?.parse()?,
            "--room" => surroundings = Surroundings::Room,
            _ => return Err(format!("unknown: {argument}").into()),
        }
    }
    let makehuman =
        PathBuf::from(std::env::var_os("MON3TR_MAKEHUMAN").ok_or("no MON3TR_MAKEHUMAN")?);
    let mut body = BareBody::open(&makehuman)?;
    let mut sight = Sight::open(&GpuChoice::Auto)?;
    let mut networks = Networks::open(None)?;
    let mut random = fastrand::Rng::with_seed(7);
    for number in 0..people {
        let person = SyntheticPerson::new(&mut body, &makehuman, number)?;
        let stance = person.stance();
        let scan_options = ScanOptions {
            surroundings,
            ..Default::default()
        };
        let mut truth = person.reposed(&scan_options, &stance);
        surroundings.add(&mut truth, 5);
        let height = person
            .posed(&stance)
            .iter()
            .map(|v| v.y)
            .fold(0.0, f64::max);
        // The pelvis may be turned below the shoulders: what faces forwards is the mean, as for the landmarks.
        let true_joint = |joint: Joint| stance.joints[joint.index()];
        let left = true_joint(Joint::LeftShoulder) - true_joint(Joint::RightShoulder)
            + true_joint(Joint::LeftHip)
            - true_joint(Joint::RightHip);
        let truly_front = left.cross(DVec3::Y).normalize();
        for turn in 0..turns {
            // One of the 24 right-angled turns, then a tilt of up to 15 degrees.
            let (quarter, side) = (random.u8(0..4), random.u8(0..6));
            let upright = Quat::from_rotation_y(f32::from(quarter) * FRAC_PI_2);
            let side = match side {
                0..=3 => Quat::from_rotation_x(f32::from(side) * FRAC_PI_2),
                4 => Quat::from_rotation_z(FRAC_PI_2),
                _ => Quat::from_rotation_z(-FRAC_PI_2),
            };
            let mut tilt = || (random.f32() * 2.0 - 1.0) * 15.0_f32.to_radians();
            let tilt = if turn == 0 {
                Quat::IDENTITY
            } else {
                Quat::from_euler(EulerRot::XYZ, tilt(), 0.0, tilt())
            };
            let all = if turn == 0 {
                Quat::IDENTITY
            } else {
                side * upright * tilt
            };
            let mut scan = truth.clone();
            scan.transform(2.7, all, Vec3::new(0.4, -1.0, 2.0));
            let options = Options {
                height: Some(height),
                ..Options::default()
            };
            let prepared = match prepare(&scan.to_scene()?, &options, &mut sight, &mut networks) {
                Ok(prepared) => prepared,
                Err(error) => {
                    println!("person {number}, turn {turn}: {error}");
                    continue;
                }
            };
            let placed = &prepared.person_from_scene;
            let rotation = placed.rotation * all.as_dquat();
            let up = rotation * DVec3::Y;
            let front = rotation * truly_front;
            let yaw = front.x.atan2(front.z).to_degrees();
            let mut errors = Vec::new();
            for (joint, landmark) in JOINTS {
                let there =
                    all * stance.joints[joint.index()].as_vec3() * 2.7 + Vec3::new(0.4, -1.0, 2.0);
                let there = placed.point(there.as_dvec3());
                errors.push(1e3 * (prepared.body[landmark].position - there).length());
            }
            let mean = errors.iter().sum::<f64>() / 12.0;
            let most = errors.iter().copied().fold(0.0, f64::max);
            let figures = &prepared.figures;
            println!(
                "person {number}, turn {turn}: up off {:.1} degrees (pitch {:.1}, roll {:.1}), yaw {yaw:.1}, size {:.3}, joints {mean:.0} mm, most {most:.0}; residual {:.1} mm, \
                 face {:.2} mm, {} planes, {} Gaussians, {} candidates, {:.1} % beside, {:.1} s",
                up.angle_between(DVec3::Y).to_degrees(),
                up.z.asin().to_degrees(),
                up.x.asin().to_degrees(),
                placed.scale * 2.7,
                1e3 * figures.body_residual,
                1e3 * figures.face_residual.unwrap_or(f64::NAN),
                figures.planes,
                figures.gaussians,
                figures.candidates.len(),
                100.0 * figures.beside,
                figures.steps.iter().map(|step| step.seconds).sum::<f64>(),
            );
        }
    }
    Ok(())
}
