//! The solver against derivatives by differences and against a forward kinematics that shares no code with it.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]

mod common;

use common::{Random, V3};
use motion_fit::body::{
    chain::{Attachment, BODY_JOINTS, Chain, Posture},
    prior::PosePrior,
    so3,
    solver::{SkeletonSolver, UNKNOWNS},
    terms::{Term, View},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use spmm3::{Joint, MotionParams};

fn solver() -> SkeletonSolver {
    SkeletonSolver::new(Chain::new(&common::skeleton()), PosePrior::default())
}

fn vector(random: &mut Random, size: f64) -> Vector3<f64> {
    Vector3::from(random.normals()) * size
}

fn view() -> View {
    View {
        camera_from_world: so3::exp(&Vector3::new(0.2, 0.1, -0.05))
            .to_rotation_matrix()
            .into_inner()
            * Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
        translation: Vector3::new(0.1, 1.1, 3.2),
        focal: 800.0,
        centre: Vector2::new(320.0, 250.0),
    }
}

#[test]
fn the_gradient_is_that_of_the_cost() {
    let mut random = Random(5);
    for round in 0..6 {
        let mut solver = solver();
        solver.views.push(view());
        let mut posture = Posture {
            position: vector(&mut random, 0.3),
            ..Posture::default()
        };
        for rotation in &mut posture.rotations {
            *rotation = so3::exp(&vector(&mut random, 0.7));
        }
        let spread = |random: &mut Random| {
            let a = Matrix3::from_fn(|_, _| random.normal());
            a * a.transpose()
        };
        for joint in [
            Joint::LeftWrist,
            Joint::RightFoot,
            Joint::Head,
            Joint::Pelvis,
        ] {
            let at = Attachment::new(joint, vector(&mut random, 0.1));
            let others = [
                (at, 1.0),
                (Attachment::centre(Joint::LeftHip), -0.5),
                (
                    Attachment::new(Joint::RightHip, vector(&mut random, 0.1)),
                    -0.5,
                ),
            ];
            let target = vector(&mut random, 0.5);
            let information = spread(&mut random);
            solver
                .terms
                .push(Term::sum(&others, target, information).robustly(2.0));
            solver.terms.push(Term::at(at, target, information));
            let pixel = Term::Pixel {
                point: at,
                view: 0,
                target: Vector2::new(300.0, 200.0) + vector(&mut random, 50.0).xy(),
                information: 1e-3,
                robust: Some(3.0),
            };
            solver.terms.push(pixel);
            solver.terms.push(Term::Orientation {
                joint,
                target: so3::exp(&vector(&mut random, 0.5)),
                information,
                robust: None,
            });
            solver.terms.push(Term::Rotation {
                joint,
                target: so3::exp(&vector(&mut random, 0.5)),
                information,
                robust: Some(1.0),
            });
            solver.terms.push(Term::Direction {
                joint,
                axis: Vector3::y(),
                target: Vector3::new(0.6, 0.8, 0.0),
                information,
                robust: None,
            });
        }
        let (_, gradient) = solver.cost(&posture);
        let gradient: [f64; UNKNOWNS] = *gradient;
        let largest = gradient.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        for unknown in 0..UNKNOWNS {
            let step = 1e-5;
            let mut at = |sign: f64| {
                let mut moved = posture;
                let mut turn = Vector3::zeros();
                turn[unknown % 3] = sign * step;
                if unknown < 3 {
                    moved.position += turn;
                } else {
                    let joint = unknown / 3 - 1;
                    moved.rotations[joint] = so3::exp(&turn) * moved.rotations[joint];
                }
                solver.cost(&moved).0
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
            // Half of the cost's slope: the cost has squares without a half.
            let error = (slope / 2.0 - gradient[unknown]).abs();
            assert!(
                error < 1e-5 * largest,
                "round {round}, unknown {unknown}: {} by differences, {} by the solver",
                slope / 2.0,
                gradient[unknown]
            );
        }
    }
}

#[test]
fn tangents_and_rotations_are_inverse_up_to_half_a_turn() {
    let mut random = Random(9);
    for size in [1e-9, 1e-5, 0.1, 1.0, 3.1, std::f64::consts::PI - 1e-6] {
        for _ in 0..50 {
            let v = vector(&mut random, 1.0).normalize() * size;
            let back = so3::log(&so3::exp(&v));
            assert!((back - v).norm() < 1e-8, "{v} came back as {back}");
        }
    }
}

/// A pose within every joint's range.
fn pose(random: &mut Random) -> MotionParams {
    let mut motion = MotionParams::default();
    let mut set = |joint: Joint, v: [f64; 3]| {
        motion.set_axis_angle(joint, glam::DVec3::from(v).as_vec3());
    };
    set(Joint::Pelvis, [0.2, 0.8, 0.2].map(|s| s * random.signed()));
    for joint in Joint::ALL.into_iter().take(BODY_JOINTS).skip(1) {
        let r: V3 = [random.signed(), random.signed(), random.signed()];
        let u = random.unit();
        let v = match joint {
            Joint::LeftHip | Joint::RightHip => [-0.4 + 0.6 * r[0], 0.3 * r[1], 0.3 * r[2]],
            Joint::LeftKnee | Joint::RightKnee => [0.15 + 1.5 * u, 0.0, 0.0],
            Joint::LeftElbow => [0.0, -0.15 - 1.8 * u, 0.0],
            Joint::RightElbow => [0.0, 0.15 + 1.8 * u, 0.0],
            Joint::LeftShoulder => [0.4 * r[0], -0.4 + 0.6 * r[1], -0.7 + 0.7 * r[2]],
            Joint::RightShoulder => [0.4 * r[0], 0.4 + 0.6 * r[1], 0.7 + 0.7 * r[2]],
            Joint::LeftFoot | Joint::RightFoot | Joint::LeftCollar | Joint::RightCollar => [0.0; 3],
            _ => [0.2 * r[0], 0.2 * r[1], 0.2 * r[2]],
        };
        set(joint, v);
    }
    motion.root_translation = glam::Vec3::new(0.2, 0.0, 0.3) * random.signed() as f32;
    motion
}

#[test]
fn seen_poses_are_found_to_a_millimetre_and_half_a_degree() {
    let skeleton = common::skeleton();
    let mut random = Random(3);
    let mut worst: [f64; 2] = [0.0; 2];
    let mut failed = 0;
    for _ in 0..60 {
        let motion = pose(&mut random);
        let (rotations, positions) = common::forward(&skeleton, &motion);
        let mut solver = solver();
        solver.views.push(view());
        let view = view();
        for joint in Joint::ALL.into_iter().take(BODY_JOINTS) {
            // The joint and two points beside it, so that every turn is seen.
            for offset in [[0.0; 3], [0.1, 0.02, 0.0], [0.0, 0.0, 0.1]] {
                let i = joint.index();
                let at = common::add(positions[i], common::mul_v(&rotations[i], offset));
                let at = Vector3::from(at);
                let point = Attachment::new(joint, offset.into());
                solver
                    .terms
                    .push(Term::at(point, at, Matrix3::identity() * 625.0));
                solver.terms.push(Term::Pixel {
                    point,
                    view: 0,
                    target: view.project(&at),
                    information: 0.1,
                    robust: None,
                });
            }
        }
        let mut posture = Posture {
            position: Vector3::new(0.0, 1.0, 0.0),
            ..solver.prior.posture()
        };
        // First with the prior, which leads past minima of twisted limbs, then by what is seen alone.
        solver.solve(&mut posture, 25);
        solver.prior_weight = 1e-7;
        solver.limit_weight = 1e-3;
        solver.solve(&mut posture, 25);
        let placed = solver.chain().place(&posture);
        let mut bad = [0.0_f64; 2];
        for joint in 0..BODY_JOINTS {
            let distance = (placed.positions[joint] - Vector3::from(positions[joint])).norm();
            let ours: common::M3 =
                std::array::from_fn(|i| std::array::from_fn(|k| placed.rotations[joint][(i, k)]));
            let turn = common::angle(&common::mul(&ours, &common::transpose(&rotations[joint])));
            bad = [bad[0].max(distance * 1e3), bad[1].max(turn.to_degrees())];
        }
        if bad[0] > 1.0 || bad[1] > 0.5 {
            failed += 1;
        }
        worst = [worst[0].max(bad[0]), worst[1].max(bad[1])];
    }
    println!(
        "worst of 60 poses: {:.4} mm, {:.4} degrees",
        worst[0], worst[1]
    );
    assert_eq!(failed, 0, "poses not found; worst {worst:?}");
}
