//! Avatars assembled from synthetic people whose registration is known exactly.

use glam::{DMat3, DVec3, Vec3};
use reconstruct::BareBody;
use scan_rig::body::posing::{JointPose, t_pose};
use scan_rig::finish::{FinishOptions, Finished, Material, Poser, avatar};
use scan_rig::synthetic::{ScanOptions, SyntheticPerson, SyntheticScan};
use spmm3::{Avatar, JOINTS, Joint, MotionParams, Template};
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

/// A person, its scan, and the avatar of its exact registration.
struct Case {
    person: SyntheticPerson,
    options: ScanOptions,
    scan: SyntheticScan,
    finished: Finished,
}

fn case(number: usize, finish: &FinishOptions) -> Option<Case> {
    let makehuman = makehuman()?;
    let mut body = BareBody::open(&makehuman).expect("the package is whole");
    let person = SyntheticPerson::new(&mut body, &makehuman, number).expect("a person");
    let options = ScanOptions {
        gaussians: 9_000,
        ..ScanOptions::default()
    };
    let scan = person.scan(&options);
    let stance = person.stance();
    let scan_pose = JointPose {
        rotations: stance.rotations,
        joints: stance.joints,
    };
    let tpose = JointPose::chained(&t_pose(person.rest_joints()), person.rest_joints(), 1.0);
    let (vertices, none) = (person.posed(&stance), Default::default());
    let finished = avatar(
        &Material {
            scan: &scan.scan,
            triangles: &scan.triangles,
            vertices: &vertices,
            faces: person.faces(),
            weights: person.weights(),
            body_vertices: body.body_vertices(),
            scan_pose: &scan_pose,
            tpose: &tpose,
            expressions: &[],
            presets: &none,
            scale: 1.0,
            casters: person.faces(),
        },
        finish,
    )
    .expect("an avatar");
    Some(Case {
        person,
        options,
        scan,
        finished,
    })
}

/// A whole avatar, built once for all tests that only look at it.
fn whole() -> Option<&'static Case> {
    static CASE: OnceLock<Option<Case>> = OnceLock::new();
    CASE.get_or_init(|| case(2, &FinishOptions::default()))
        .as_ref()
}

/// The largest and the mean distance between two lists of points, metres, the second one's order found by its nearest points.
fn away(from: &[Vec3], to: &[Vec3]) -> (f32, f32) {
    let distance = |p: &Vec3| {
        let near = to.iter().map(|q| q.distance_squared(*p));
        near.fold(f32::INFINITY, f32::min).sqrt()
    };
    let all: Vec<f32> = from.iter().step_by(7).map(distance).collect();
    let sum: f32 = all.iter().sum();
    (
        all.iter().copied().fold(0.0, f32::max),
        sum / all.len().max(1) as f32,
    )
}

#[test]
fn posed_as_in_the_scan_the_avatar_is_the_scan() {
    let Some(case) = whole() else {
        return;
    };
    let Finished {
        avatar,
        scan_motion,
    } = &case.finished;
    let poser = Poser::new(avatar).expect("its networks");
    let again = poser.scan(scan_motion).expect("a pose");
    assert_eq!(again.len(), case.scan.scan.len(), "every Gaussian");
    let (max, mean) = away(&again.positions, &case.scan.scan.positions);
    println!(
        "re-posed to the scan: {:.3} mm mean, {:.3} max",
        mean * 1e3,
        max * 1e3
    );
    assert!(max < 5e-4, "{max} m");
    // The joints are where they truly are.
    let joints = avatar.skeleton.pose(scan_motion);
    for joint in Joint::ALL {
        let at = joints.position(joint) + scan_motion.root_translation;
        let truth = case.scan.joints[joint.index()].as_vec3();
        assert!(
            at.distance(truth) < 1e-4,
            "{}: {at} for {truth}",
            joint.name()
        );
    }
}

#[test]
fn the_template_stands_upright_on_its_soles_with_its_arms_stretched() {
    let Some(case) = whole() else {
        return;
    };
    let template: &Template = &case.finished.avatar.template;
    let lowest = template
        .vertices()
        .iter()
        .map(|v| v.y)
        .fold(f32::INFINITY, f32::min);
    assert!(lowest.abs() < 1e-4, "soles at {lowest}");
    let rest = case.finished.avatar.skeleton.rest_positions();
    let at = |joint: Joint| rest[joint.index()];
    for (shoulder, wrist, side) in [
        (Joint::LeftShoulder, Joint::LeftWrist, 1.0),
        (Joint::RightShoulder, Joint::RightWrist, -1.0),
    ] {
        let arm = (at(wrist) - at(shoulder)).normalize();
        assert!(arm.x * side > 0.999, "an arm along x: {arm}");
    }
    assert!(at(Joint::LeftFoot).z > at(Joint::LeftAnkle).z, "toes ahead");
    let (low, high) = (template.vertices().iter())
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| {
            (l.min(v.x), h.max(v.x))
        });
    assert!(high - low > 1.2, "the arms' span is {}", high - low);
}

#[test]
fn a_novel_pose_is_the_true_persons() {
    let Some(case) = whole() else {
        return;
    };
    let Finished { avatar, .. } = &case.finished;
    let poser = Poser::new(avatar).expect("its networks");
    let mut motion = MotionParams::default();
    motion.set_axis_angle(Joint::LeftShoulder, Vec3::new(0.0, -0.3, 0.5));
    motion.set_axis_angle(Joint::RightElbow, Vec3::new(0.0, 0.9, 0.0));
    motion.set_axis_angle(Joint::LeftHip, Vec3::new(-0.8, 0.0, 0.0));
    motion.set_axis_angle(Joint::LeftKnee, Vec3::new(0.9, 0.0, 0.0));
    let joints = avatar.skeleton.pose(&motion);
    let rotations: [DMat3; JOINTS] = joints.person_from_joint.map(|frame| {
        let [x, y, z] = [
            frame.matrix3.x_axis,
            frame.matrix3.y_axis,
            frame.matrix3.z_axis,
        ]
        .map(|a| DVec3::new(a.x.into(), a.y.into(), a.z.into()));
        DMat3::from_cols(x, y, z)
    });
    let truth = case
        .person
        .reposed(&case.options, &case.person.as_avatar(&rotations));
    let posed = poser.scan(&motion).expect("a pose");
    let (max, mean) = away(&posed.positions, &truth.positions);
    println!(
        "a novel pose: {:.2} mm mean, {:.1} max",
        mean * 1e3,
        max * 1e3
    );
    // The jitter of the scan's Gaussians turns with the limbs; the truth's does not.
    assert!(mean < 2.5e-3 && max < 0.04, "{mean} m mean, {max} m max");
}

#[test]
fn a_package_reads_as_it_was_written_and_keeps_to_its_size() {
    let options = FinishOptions {
        name: "a synthetic person".into(),
        provenance: "made up".into(),
        licence: "none".into(),
        gaussians: Some(3_000),
    };
    let Some(case) = case(3, &options) else {
        return;
    };
    let avatar = &case.finished.avatar;
    assert_eq!(avatar.gaussians.len(), 3_000, "as many as asked for");
    let bytes = avatar.to_bytes().expect("a package");
    println!(
        "{} Gaussians in {:.2} MB",
        avatar.gaussians.len(),
        bytes.len() as f64 / 1e6
    );
    let again = Avatar::read(std::io::Cursor::new(&bytes)).expect("a sound package");
    assert!(again == *avatar, "it comes back as it was");
}
