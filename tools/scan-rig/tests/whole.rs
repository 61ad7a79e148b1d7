//! The whole way, from a scan to an avatar that captured motion drives, on two synthetic people.

use glam::{DVec3, Vec3};
use reconstruct::BareBody;
use renderer_vulkan::choice::GpuChoice;
use scan_rig::RigError;
use scan_rig::finish::{FinishOptions, Poser};
use scan_rig::pipeline::{RigOptions, Rigged, STEPS, rig};
use scan_rig::prepare::{self, Networks};
use scan_rig::shell::Hands;
use scan_rig::sight::Sight;
use scan_rig::synthetic::{Fault, ScanOptions, Surroundings, SyntheticPerson, SyntheticScan};
use splat_scene::Scene;
use spmm3::{Avatar, Joint, LoadOptions, MotionClip, Playback};
use std::cell::RefCell;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, OnceLock};
use synthetic_person::real_files::real_file;

/// Gaussians of the scans: few, so that the test is quick.
const GAUSSIANS: usize = 30_000;

/// Joints are this near to the truth on the mean and at most, metres.
const NEAR: (f64, f64) = (0.013, 0.027);

/// The person faces forwards to this, degrees, and is as large as given to this share.
const FACING: f64 = 2.0;
const SIZE: f64 = 0.0022;

/// Gaussians are this near to the body's surface whatever it does, metres.
const REACH: f32 = 0.06;

/// What looks at scans: one device for all tests, as a program has.
struct Tools {
    makehuman: PathBuf,
    sight: Sight,
    networks: Networks,
}

fn tools() -> Option<MutexGuard<'static, Tools>> {
    static TOOLS: OnceLock<Option<Mutex<Tools>>> = OnceLock::new();
    let tools = TOOLS.get_or_init(|| {
        let found = open();
        if let Err(why) = &found {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
            println!("skipped: {why}");
        }
        found.ok().map(Mutex::new)
    });
    tools
        .as_ref()
        .map(|tools| tools.lock().expect("no test panicked with it"))
}

fn open() -> Result<Tools, String> {
    let makehuman = std::env::var_os("MON3TR_MAKEHUMAN")
        .ok_or("MON3TR_MAKEHUMAN does not name the MakeHuman data")?;
    let gpu = std::env::var("MON3TR_GPU").unwrap_or_default();
    let choice: GpuChoice = gpu.parse().map_err(|_| "MON3TR_GPU names no device")?;
    Ok(Tools {
        makehuman: makehuman.into(),
        networks: Networks::open(None).map_err(|e| e.to_string())?,
        sight: Sight::open(&choice).map_err(|e| e.to_string())?,
    })
}

impl Tools {
    fn person(&self, number: usize) -> SyntheticPerson {
        let mut body = BareBody::open(&self.makehuman).expect("the package is whole");
        SyntheticPerson::new(&mut body, &self.makehuman, number).expect("a person")
    }

    fn rig(&mut self, scene: &Scene, height: f64) -> Result<Rigged, RigError> {
        let options = RigOptions {
            makehuman: self.makehuman.clone(),
            person: prepare::Options {
                height: Some(height),
                ..prepare::Options::default()
            },
            accessories: true,
            hands: [Hands::AsSeen; 2],
            finish: FinishOptions::default(),
        };
        let told = RefCell::new(Vec::new());
        let rigged = rig(
            scene,
            &options,
            &mut self.sight,
            &mut self.networks,
            &|step| {
                told.borrow_mut().push(step);
            },
        );
        if rigged.is_ok() {
            assert_eq!(told.into_inner(), STEPS, "every step was told of");
        }
        rigged
    }
}

/// `unit`: how long a metre is in the scene.
fn check_joints(rigged: &Rigged, truth: &SyntheticScan, unit: f64) {
    let errors: Vec<f64> = (Joint::ALL.into_iter().take(Joint::Jaw.index()))
        .map(|joint| {
            let at = rigged.person_from_scene.point(truth.joints[joint.index()]);
            rigged.joints[joint.index()].distance(at)
        })
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let max = errors.iter().copied().fold(0.0, f64::max);
    println!("joints: {:.1} mm mean, {:.1} max", mean * 1e3, max * 1e3);
    assert!(mean < NEAR.0 && max < NEAR.1, "{mean} m mean, {max} m max");
    // Upright: the head above the feet, looking ahead.
    let at = |joint: Joint| rigged.person_from_scene.point(truth.joints[joint.index()]);
    let left = at(Joint::LeftShoulder) - at(Joint::RightShoulder) + at(Joint::LeftHip)
        - at(Joint::RightHip);
    let forward = left.cross(DVec3::Y).normalize();
    let yaw = forward.x.atan2(forward.z).to_degrees();
    let up = (at(Joint::Head) - at(Joint::Pelvis)).normalize();
    assert!(
        yaw.abs() < FACING && up.y > 0.95,
        "facing {yaw} degrees off, up {up}"
    );
    let placement = &rigged.report.placement;
    let size = placement.metres_per_unit * unit - 1.0;
    println!("facing {yaw:.1} degrees off, size {:.2} %", 100.0 * size);
    assert!(size.abs() < SIZE, "{} % too large", 100.0 * size);
}

/// What is told of the avatar says how the person stands in the file.
fn check_report(rigged: &Rigged, up: Vec3) {
    let report = serde_json::to_value(&rigged.report).expect("a report");
    let told: Vec<f64> = (report["placement"]["up"].as_array().expect("three"))
        .iter()
        .filter_map(serde_json::Value::as_f64)
        .collect();
    let apart = DVec3::from_slice(&told).angle_between(up.as_dvec3());
    assert!(apart < 0.05, "up is {told:?}");
    let text = report.to_string();
    assert!(
        !text.contains("seconds"),
        "two packages of one scan would differ"
    );
    let best = &report["prepare"]["candidates"][0]["score"];
    assert!(best.as_f64().is_some_and(|score| score > 1.0), "{best}");
    let own = report["prepare"]["gaussians"].as_u64().expect("a count");
    let all = report["scene_gaussians"].as_u64().expect("a count");
    assert!(own > 20_000 && own <= all, "{own} of {all}");
}

/// The package comes back, and no Gaussian leaves the body in captured motion.
fn check_avatar(rigged: &Rigged) {
    let bytes = rigged.avatar.to_bytes().expect("a package");
    println!(
        "{} Gaussians, {:.1} MB",
        rigged.avatar.gaussians.len(),
        bytes.len() as f64 / 1e6
    );
    let avatar = Avatar::read(Cursor::new(&bytes)).expect("a sound package");
    assert!(avatar == rigged.avatar, "it comes back as it was");
    let poser = Poser::new(&avatar).expect("its networks");
    for (file, moments) in [
        ("mocap/cmu_02_01_walk.bvh", [0.5, 1.5]),
        ("mocap/cmu_02_05_punch.bvh", [4.0, 7.0]),
    ] {
        let Some(file) = real_file(file) else {
            continue;
        };
        let clip =
            MotionClip::load(&file, &avatar.skeleton, &LoadOptions::default()).expect("the motion");
        for moment in moments {
            let motion = clip.sample(moment, Playback::Clamp);
            let vertices = poser.vertices(&motion);
            let posed = poser.gaussians(&motion).expect("a pose");
            let far = posed.positions.iter().zip(avatar.gaussians.corners());
            let far = far.filter(|(at, corners)| {
                let [a, b, c] = corners.map(|v| vertices[v as usize]);
                distance(**at, [a, b, c]) > REACH
            });
            let far = far.count();
            assert_eq!(
                far, 0,
                "Gaussians off the body at {moment} s of {}",
                clip.name
            );
        }
    }
}

/// How far a point is from a triangle, at most: to its nearest corner or middle.
fn distance(point: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    [a, b, c, (a + b + c) / 3.0]
        .iter()
        .map(|corner| corner.distance(point))
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn a_scan_becomes_an_avatar_whose_joints_are_the_persons() {
    let Some(mut tools) = tools() else { return };
    // A tall person in one colour, whose knees the network has much too high.
    let truth = tools.person(6).scan(&ScanOptions {
        gaussians: GAUSSIANS,
        ..ScanOptions::default()
    });
    let [left, right] = [Joint::LeftAnkle, Joint::RightAnkle].map(|j| truth.joints[j.index()].y);
    assert!((left - right).abs() < 0.002, "on one leg: {left}, {right}");
    let scene = truth.scan.to_scene().expect("a scene");
    let rigged = tools.rig(&scene, truth.height).expect("an avatar");
    check_joints(&rigged, &truth, 1.0);
    check_report(&rigged, Vec3::Y);
    check_avatar(&rigged);
}

#[test]
fn a_scan_in_a_room_and_in_a_unit_of_its_own_becomes_one_as_well() {
    let Some(mut tools) = tools() else { return };
    let truth = tools.person(3).scan(&ScanOptions {
        gaussians: GAUSSIANS,
        surroundings: Surroundings::Room,
        unit: 0.7,
        ..ScanOptions::default()
    });
    // As a file, which turns its axes.
    let bytes = truth.scan.to_scene().expect("a scene").to_ply();
    let scene = Scene::read(&bytes, "scan.ply").expect("a file");
    let rigged = tools.rig(&scene, truth.height).expect("an avatar");
    check_joints(&rigged, &truth, 0.7);
    check_report(&rigged, Vec3::NEG_Y);
    check_avatar(&rigged);
}

#[test]
fn what_is_no_scan_of_one_whole_person_is_refused_with_what_to_do() {
    let Some(mut tools) = tools() else { return };
    let person = tools.person(1);
    for fault in [Fault::HalfAPerson, Fault::TwoPeople] {
        let truth = person.scan(&ScanOptions {
            gaussians: GAUSSIANS,
            fault: Some(fault),
            ..ScanOptions::default()
        });
        let scene = truth.scan.to_scene().expect("a scene");
        let error = tools.rig(&scene, truth.height).expect_err("no avatar");
        println!("{fault:?}: {error}");
        assert!(
            matches!(error, RigError::Unsuited { .. }),
            "{fault:?}: {error}"
        );
    }
}
