//! Binding, on Gaussians laid on the body model itself: which triangle each belongs to, and what moves with what, is known.

use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use scan_rig::bind::{BindOptions, Bound, bind};
use scan_rig::body::posing::{chain, posed_from_rest, skinned};
use scan_rig::body::{BodyModel, BodyPart, Registered};
use scan_rig::scan::Scan;
use scan_rig::surface::survey;
use spmm3::{JOINTS, Joint};
use std::collections::HashMap;
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

/// The body model, built once; nothing, after a line that says so, where MakeHuman was not fetched. On CI that is a failure.
fn model() -> Option<&'static BodyModel> {
    static MODEL: OnceLock<Option<BodyModel>> = OnceLock::new();
    MODEL
        .get_or_init(|| {
            makehuman().map(|folder| BodyModel::load(&folder).expect("the package is whole"))
        })
        .as_ref()
}

/// The model with the arms nearly at the body, and the pose that it is in.
fn standing(model: &BodyModel) -> Registered {
    let mut rotations = [DMat3::IDENTITY; JOINTS];
    for (shoulder, angle) in [(Joint::LeftShoulder, -0.45), (Joint::RightShoulder, 0.45)] {
        for joint in Joint::ALL {
            let mut above = Some(joint);
            while let Some(at) = above {
                if at == shoulder {
                    rotations[joint.index()] = DMat3::from_rotation_z(angle);
                }
                above = at.parent();
            }
        }
    }
    let joints = chain(&rotations, DVec3::Y * 0.95, 1.0, &model.joints);
    let maps = posed_from_rest(&rotations, &joints, 1.0, &model.joints);
    let mut vertices = skinned(&model.weights, &maps, &model.rest);
    let floor = vertices.iter().fold(f64::INFINITY, |y, v| y.min(v.y));
    for vertex in &mut vertices {
        vertex.y -= floor;
    }
    Registered {
        shape: vec![0.0; model.shapes.len()],
        rotations,
        scale: 1.0,
        joints: joints.map(|joint| joint - DVec3::Y * floor),
        vertices,
        confidence: [1.0; JOINTS],
    }
}

/// Gaussians on the skin, four on every triangle, and their triangles.
fn dressed(model: &BodyModel, body: &Registered) -> (Scan, Vec<u32>) {
    let mut scan = Scan::default();
    let mut triangles = Vec::new();
    for (at, face) in (0_u32..).zip(&model.faces) {
        let skin = matches!(
            model.parts[at as usize],
            BodyPart::Skin | BodyPart::Face | BodyPart::Head | BodyPart::Hand
        );
        if !skin {
            continue;
        }
        let [a, b, c] = face.map(|v| body.vertices[v as usize].as_vec3());
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let across = (b - a).reject_from(normal).normalize_or_zero();
        let turn = Mat3::from_cols(across, normal.cross(across), normal);
        let size = ((b - a).cross(c - a).length() / 2.0).sqrt();
        for (v, w) in [(0.33, 0.33), (0.1, 0.1), (0.8, 0.1), (0.1, 0.8)] {
            scan.positions.push(a + (b - a) * v + (c - a) * w);
            scan.rotations.push(Quat::from_mat3(&turn).normalize());
            scan.scales
                .push(Vec3::new(size, size, 0.001) * 0.45 + 0.0005);
            scan.opacities.push(0.95);
            let grain = (at % 7) as f32 / 7.0;
            scan.colours.push(Vec3::new(0.4 + 0.3 * grain, 0.5, 0.3));
            triangles.push(at);
        }
    }
    (scan, triangles)
}

/// The joint that moves a face of the bound mesh the most.
fn joint_of(bound: &Bound, face: u32) -> Joint {
    let corners = bound.mesh.faces[face as usize];
    let weight = |joint: Joint| -> f32 {
        corners
            .iter()
            .map(|v| bound.mesh.weights[*v as usize][joint.index()])
            .sum()
    };
    Joint::ALL
        .into_iter()
        .max_by(|a, b| weight(*a).total_cmp(&weight(*b)))
        .expect("55 joints")
}

#[test]
fn gaussians_on_a_body_are_bound_where_they_are_and_move_with_it() {
    let Some(model) = model() else { return };
    let body = standing(model);
    let (scan, truth) = dressed(model, &body);
    let seen = survey(&scan);
    let bound = bind(&scan, &seen, model, &body, &BindOptions::default()).expect("bound");
    let report = &bound.report;
    println!("{report:?}");
    assert!(report.accessories.is_empty(), "a bare body wears nothing");
    let left_out = report.given - (report.kept - report.split);
    assert!(
        left_out * 10 < report.given,
        "{left_out} of {} left out",
        report.given
    );
    assert!(report.offsets.p99 < 0.01, "{:?}", report.offsets);

    // Gaussians still where they were given: their triangle's limb is the true one's.
    let rest = bound.rest(model, &body).expect("at rest");
    let bits = |position: &Vec3| position.to_array().map(f32::to_bits);
    let given: HashMap<[u32; 3], u32> = (scan.positions.iter().map(bits)).zip(truth).collect();
    let (mut same, mut all) = (0, 0);
    for (position, triangle) in bound.scan.positions.iter().zip(&bound.triangles) {
        if let Some(truth) = given.get(&bits(position)) {
            all += 1;
            let (a, b) = (joint_of(&bound, *triangle), joint_of(&bound, *truth));
            same += usize::from(a == b || a.parent() == Some(b) || b.parent() == Some(a));
        }
    }
    assert!(all > 80_000, "{all} compared");
    assert!(same * 1000 > all * 998, "{same} of {all} on the right limb");

    // The T-pose: arms along x, soles on the floor, as tall as it stood.
    let hand = rest.skeleton.rest_positions()[Joint::LeftWrist.index()];
    let shoulder = rest.skeleton.rest_positions()[Joint::LeftShoulder.index()];
    assert!(
        (hand.y - shoulder.y).abs() < 0.02 && hand.x > shoulder.x + 0.4,
        "{hand} from {shoulder}"
    );
    let floor = rest.vertices.iter().fold(f64::INFINITY, |y, v| y.min(v.y));
    assert!(floor.abs() < 1e-9, "{floor}");
}

#[test]
fn a_ball_in_the_hand_moves_with_the_wrist_and_nothing_else_does() {
    let Some(model) = model() else { return };
    let body = standing(model);
    let (mut scan, _) = dressed(model, &body);
    let own = scan.len();
    let hand = body.joints[Joint::LeftMiddle2.index()].as_vec3();
    let centre = hand + Vec3::new(0.07, -0.11, 0.03);
    let mut random = fastrand::Rng::with_seed(5);
    for _ in 0..6000 {
        let mut side = || random.f32() * 2.0 - 1.0;
        let out = Vec3::new(side(), side(), side()).normalize_or(Vec3::X);
        scan.positions.push(centre + out * 0.12);
        scan.rotations.push(Quat::from_rotation_arc(Vec3::Z, out));
        scan.scales.push(Vec3::new(0.005, 0.005, 0.001));
        scan.opacities.push(0.95);
        scan.colours.push(Vec3::X);
    }
    let seen = survey(&scan);
    let bound = bind(&scan, &seen, model, &body, &BindOptions::default()).expect("bound");
    let [ball] = &bound.report.accessories[..] else {
        panic!("{:?}", bound.report.accessories);
    };
    assert_eq!(ball.joint, Joint::LeftWrist, "{ball:?}");
    let red = |at: usize| bound.scan.colours[at] == Vec3::X;
    let all = (0..bound.scan.len()).filter(|at| red(*at)).count();
    let carried = (0..bound.scan.len())
        .filter(|at| red(*at) && bound.accessory[*at] == 1)
        .count();
    assert!(carried * 100 >= all * 97, "{carried} of {all} of the ball");
    let taken: Vec<Joint> = (0..bound.scan.len())
        .filter(|at| !red(*at) && bound.accessory[*at] == 1)
        .map(|at| {
            let position = bound.scan.positions[at].as_dvec3();
            let squared = |j: &Joint| body.joints[j.index()].distance_squared(position);
            *Joint::ALL
                .iter()
                .min_by(|a, b| squared(a).total_cmp(&squared(b)))
                .expect("some")
        })
        .collect();
    let of_hand = taken
        .iter()
        .filter(|j| j.index() >= 25 || **j == Joint::LeftWrist)
        .count();
    assert!(
        of_hand * 100 >= taken.len() * 98,
        "{of_hand} of {} are the hand's",
        taken.len()
    );
    assert!(taken.len() * 10 < own, "{} of the body taken", taken.len());

    let none = BindOptions { accessories: false };
    let bound = bind(&scan, &seen, model, &body, &none).expect("bound");
    assert!(bound.accessory.iter().all(|a| *a == 0), "asked for none");
}

#[test]
fn what_fits_no_registration_is_refused() {
    let Some(model) = model() else { return };
    let mut body = standing(model);
    let (scan, _) = dressed(model, &body);
    let few = scan.filtered(&vec![false; scan.len()]);
    let options = BindOptions::default();
    assert!(
        bind(&few, &survey(&few), model, &body, &options).is_err(),
        "of nothing"
    );
    body.vertices.pop();
    assert!(
        bind(&few, &survey(&few), model, &body, &options).is_err(),
        "of another body"
    );
}
