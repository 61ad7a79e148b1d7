//! Scans as they come, turned, tilted, crowded and damaged, prepared by the real renderer and the real networks; the truth is that of people who
//! do not exist.

use glam::{DVec3, EulerRot, Quat, Vec3};
use reconstruct::BareBody;
use renderer_vulkan::choice::GpuChoice;
use scan_rig::RigError;
use scan_rig::prepare::landmarks::JOINTS;
use scan_rig::prepare::{Networks, Options, Prepared, prepare};
use scan_rig::scan::Scan;
use scan_rig::sight::Sight;
use scan_rig::synthetic::{Fault, ScanOptions, Stance, Surroundings, SyntheticPerson};
use splat_scene::{Scene, SceneBuilder};
use spmm3::Joint;
use std::f32::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is opened once for all tests.
struct Tools {
    sight: Sight,
    networks: Networks,
    person: SyntheticPerson,
}

static TOOLS: Mutex<Option<Tools>> = Mutex::new(None);

/// Says that a test is skipped; fails where CI demands everything.
fn skipped(why: &str) {
    assert!(std::env::var("CI").as_deref() != Ok("true"), "lacks {why}");
    println!("skipped: {why}");
}

/// The tools, one test at a time; nothing where the machine lacks one.
fn tools() -> Option<MutexGuard<'static, Option<Tools>>> {
    let mut tools = TOOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if tools.is_none() {
        let Some(makehuman) = std::env::var_os("MON3TR_MAKEHUMAN").map(PathBuf::from) else {
            skipped("MakeHuman's files (MON3TR_MAKEHUMAN)");
            return None;
        };
        let name = std::env::var("MON3TR_GPU").unwrap_or_default();
        let choice: GpuChoice = name.parse().expect("any text is a choice");
        let sight = Sight::open(&choice)
            .map_err(|why| skipped(&format!("a Vulkan device: {why}")))
            .ok()?;
        let networks = Networks::open(None)
            .map_err(|why| skipped(&format!("networks: {why}")))
            .ok()?;
        let mut body = BareBody::open(&makehuman).expect("MakeHuman's files");
        let person = SyntheticPerson::new(&mut body, &makehuman, 1).expect("a person");
        *tools = Some(Tools {
            sight,
            networks,
            person,
        });
    }
    Some(tools)
}

impl Tools {
    fn prepare(&mut self, scan: &Scan, options: &Options) -> Result<Prepared, RigError> {
        let scene = scan.to_scene().expect("a scene");
        prepare(&scene, options, &mut self.sight, &mut self.networks)
    }

    /// A person who stands, with about so many Gaussians.
    fn standing(&self, gaussians: usize) -> (Scan, Stance) {
        let stance = self.person.stance();
        let options = ScanOptions {
            gaussians,
            ..ScanOptions::default()
        };
        (self.person.reposed(&options, &stance), stance)
    }

    fn refusal(&mut self, scan: &Scan, options: &Options) -> String {
        match self.prepare(scan, options) {
            Err(RigError::Unsuited { what }) => what,
            other => panic!("no refusal: {:?}", other.map(|prepared| prepared.figures)),
        }
    }
}

/// Checks a prepared scan against the stance: `scene_from_truth` is a turn, a size and a shift.
fn check(
    prepared: &Prepared,
    stance: &Stance,
    turn: Quat,
    size: f32,
    shift: Vec3,
    degrees: f64,
    case: &str,
) {
    let at = |joint: Joint| stance.joints[joint.index()];
    let left = at(Joint::LeftShoulder) - at(Joint::RightShoulder) + at(Joint::LeftHip)
        - at(Joint::RightHip);
    let front = left.cross(DVec3::Y).normalize();
    let placed = &prepared.person_from_scene;
    let rotation = placed.rotation * turn.as_dquat();
    let tilt = (rotation * DVec3::Y).angle_between(DVec3::Y).to_degrees();
    let front = rotation * front;
    let yaw = front.x.atan2(front.z).to_degrees();
    println!(
        "{case}: up off {tilt:.1} degrees, yaw {yaw:.1}, residual {:.1} mm",
        1e3 * prepared.figures.body_residual
    );
    assert!(tilt < degrees, "{case}: up is off by {tilt} degrees");
    assert!(yaw.abs() < 5.0, "{case}: facing is off by {yaw} degrees");
    for (joint, landmark) in JOINTS {
        let there = turn * at(joint).as_vec3() * size + shift;
        let apart = (prepared.body[landmark].position - placed.point(there.as_dvec3())).length();
        assert!(apart < 0.07, "{case}: {joint:?} is {apart} m off");
    }
}

#[test]
fn a_person_is_stood_upright_and_faced_forwards_whichever_axis_is_up_and_however_the_scan_leans() {
    let Some(mut tools) = tools() else { return };
    let Some(tools) = tools.as_mut() else { return };
    let (scan, stance) = tools.standing(20_000);
    let height = f64::from(scan.positions.iter().map(|p| p.y).fold(0.0, f32::max));
    let options = Options {
        height: Some(height),
        ..Options::default()
    };
    let sides = [
        Quat::IDENTITY,
        Quat::from_rotation_x(FRAC_PI_2),
        Quat::from_rotation_x(2.0 * FRAC_PI_2),
        Quat::from_rotation_x(-FRAC_PI_2),
        Quat::from_rotation_z(FRAC_PI_2),
        Quat::from_rotation_z(-FRAC_PI_2),
    ];
    for (case, side) in (0u8..).zip(sides) {
        let lean = if case % 2 == 0 { 15.0_f32 } else { -15.0 }.to_radians();
        let lean = Quat::from_euler(EulerRot::XYZ, lean, f32::from(case) * FRAC_PI_2, 0.5 * lean);
        let (turn, size, shift) = (side * lean, 0.31, Vec3::new(4.0, -2.0, 0.7));
        let mut turned = scan.clone();
        turned.transform(size, turn, shift);
        let prepared = tools.prepare(&turned, &options).expect("a person");
        check(
            &prepared,
            &stance,
            turn,
            size,
            shift,
            3.5,
            &format!("side {case}"),
        );
        let low = prepared
            .scan
            .positions
            .iter()
            .map(|p| f64::from(p.y))
            .fold(f64::INFINITY, f64::min);
        let high = prepared
            .scan
            .positions
            .iter()
            .map(|p| f64::from(p.y))
            .fold(0.0, f64::max);
        assert!(
            low.abs() < 0.03 && (high - height).abs() < 0.03,
            "from {low} to {high} m, not {height}"
        );
        assert!(prepared.face.is_some(), "a face");
    }
}

#[test]
fn a_room_is_cut_away_and_its_floor_says_where_up_is() {
    let Some(mut tools) = tools() else { return };
    let Some(tools) = tools.as_mut() else { return };
    let (person, stance) = tools.standing(30_000);
    let mut scan = person.clone();
    Surroundings::Room.add(&mut scan, 3);
    let turn = Quat::from_euler(EulerRot::XYZ, 0.2, 1.0, -0.25);
    scan.transform(1.0, turn, Vec3::ZERO);
    let prepared = tools.prepare(&scan, &Options::default()).expect("a person");
    check(&prepared, &stance, turn, 1.0, Vec3::ZERO, 0.5, "room");
    assert_eq!(prepared.figures.planes, 1, "the floor");
    // Of the surroundings' 9,850 Gaussians nearly all must be gone, of the person's nearly none.
    let (kept, own) = (prepared.scan.len(), person.len());
    assert!(kept + 1_000 > own && kept < own + 300, "{kept} of {own}");
}

#[test]
fn two_people_are_refused_with_a_box_around_each_and_each_box_chooses_one() {
    let Some(mut tools) = tools() else { return };
    let Some(tools) = tools.as_mut() else { return };
    let options = ScanOptions {
        gaussians: 20_000,
        fault: Some(Fault::TwoPeople),
        ..ScanOptions::default()
    };
    let scan = tools.person.scan(&options).scan;
    let what = tools.refusal(&scan, &Options::default());
    assert!(what.contains("2 people"), "{what}");
    let boxes: Vec<Vec<f32>> = what
        .split("--box ")
        .skip(1)
        .map(|text| {
            let numbers = text.split(' ').next().unwrap_or_default().split(',');
            numbers
                .map(|number| number.parse().expect("a number"))
                .collect()
        })
        .collect();
    assert_eq!(boxes.len(), 2, "{what}");
    for numbers in boxes {
        let [a, b, c, d, e, f] = numbers[..] else {
            panic!("{what}")
        };
        let within = Options {
            within: Some([[a, b, c], [d, e, f]]),
            ..Options::default()
        };
        let prepared = tools.prepare(&scan, &within).expect("one of them");
        assert!(
            prepared.scan.len().abs_diff(scan.len() / 2) < 600,
            "{}",
            prepared.scan.len()
        );
    }
    let beyond = Options {
        within: Some([[90.0; 3], [91.0; 3]]),
        ..Options::default()
    };
    let what = tools.refusal(&scan, &beyond);
    assert!(what.contains("inside the box"), "{what}");
}

#[test]
fn scans_that_no_avatar_can_be_made_of_are_refused_and_say_why() {
    let Some(mut tools) = tools() else { return };
    let Some(tools) = tools.as_mut() else { return };
    let half = ScanOptions {
        gaussians: 30_000,
        fault: Some(Fault::HalfAPerson),
        ..ScanOptions::default()
    };
    let half = tools.person.scan(&half).scan;
    let (whole, stance) = tools.standing(30_000);
    let chin = stance.joints[Joint::Neck.index()].as_vec3();
    let keep: Vec<bool> = whole.positions.iter().map(|p| p.y < chin.y).collect();
    let headless = whole.filtered(&keep);
    let few: Vec<bool> = (0..whole.len()).map(|at| at % 30 == 0).collect();
    let few = whole.filtered(&few);
    let mut random = fastrand::Rng::with_seed(3);
    let mut ball = Scan::default();
    for _ in 0..20_000 {
        let mut coordinate = || random.f32() - 0.5;
        let at = Vec3::new(coordinate(), coordinate(), coordinate()).normalize_or(Vec3::X);
        ball.positions.push(at);
        ball.rotations.push(Quat::IDENTITY);
        ball.scales.push(Vec3::splat(0.02));
        ball.opacities.push(0.9);
        ball.colours.push(Vec3::splat(0.6));
    }
    for (scan, expected) in [
        (half, "a person without"),
        (headless, "a person without a head"),
        (few, "too few"),
        (ball, "no standing person"),
    ] {
        let what = tools.refusal(&scan, &Options::default());
        println!("{what}");
        assert!(what.contains(expected), "{what}");
    }
    let astray = Options {
        joints: vec![(Joint::LeftWrist, Vec3::new(0.4, 9.0, 0.1))],
        ..Options::default()
    };
    let what = tools.refusal(&whole, &astray);
    assert!(what.contains("--joint left_wrist is"), "{what}");
    let empty: Scene = SceneBuilder::new(0).expect("degree 0").finish();
    let refused = prepare(
        &empty,
        &Options::default(),
        &mut tools.sight,
        &mut tools.networks,
    );
    assert!(
        matches!(&refused, Err(RigError::Unsuited { what }) if what.contains("no Gaussians")),
        "empty"
    );
}
