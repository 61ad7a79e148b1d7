//! The person's arithmetic against its f64 reference.

use glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;
use spmm3::{
    ATTRIBUTES, BoundGaussians, GaussianSet, JOINTS, Joint, MotionParams, PARAMS, PlanarVertices,
    SkinningTransforms,
};
use std::sync::LazyLock;
use synthetic_person::reference::{self as reference, V3};
use synthetic_person::{Puppet, Random};

/// Building the puppet takes longer than a case.
static PUPPET: LazyLock<Puppet> = LazyLock::new(Puppet::small);

/// Largest distance of a coordinate, metres: f32 rounding through a chain of eleven joints is about a tenth of it.
const MICROMETRES: f64 = 5e-6;

fn far(a: V3, b: Vec3) -> f64 {
    reference::norm(reference::sub(a, reference::wide(b)))
}

/// [3, N_v] planes, as the deform graph gives them.
#[allow(
    clippy::cast_possible_truncation,
    reason = "the graph gives single precision"
)]
fn planar(points: &[V3]) -> Vec<f32> {
    (0..3)
        .flat_map(|axis| points.iter().map(move |p| p[axis] as f32))
        .collect()
}

/// Largest difference between the entries of two rotations.
fn rotation_error(a: reference::M3, q: Quat) -> f64 {
    let b = reference::quaternion_matrix([q.x, q.y, q.z, q.w].map(f64::from));
    let entries = a.iter().flatten().zip(b.iter().flatten());
    entries.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn check_gaussians(expected: &[reference::ReferenceGaussian], got: &GaussianSet) {
    assert_eq!(expected.len(), got.len(), "the number of Gaussians");
    for (i, want) in expected.iter().enumerate() {
        let moved = far(want.position, got.positions[i]);
        assert!(moved < MICROMETRES, "Gaussian {i} is {moved} m off");
        let turned = rotation_error(want.rotation, got.rotations[i]);
        assert!(turned < 2e-4, "Gaussian {i} is turned by {turned}");
        let length = f64::from(got.rotations[i].length());
        assert!(
            (length - 1.0).abs() < 1e-5,
            "quaternion {i} is {length} long"
        );
        assert!(far(want.log_scale, got.log_scales[i]) < 1e-5, "scale {i}");
        assert!(far(want.colour, got.colours[i]) < 1e-5, "colour {i}");
        let opacity = (want.opacity_logit - f64::from(got.opacity_logits[i])).abs();
        assert!(opacity < 1e-5, "opacity {i} is {opacity} off");
    }
}

fn motions(reach: f32) -> impl Strategy<Value = MotionParams> {
    any::<u64>().prop_map(move |seed| Random::new(seed).motion(reach))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn forward_kinematics_agrees_with_rodrigues_matrices(motion in motions(1.5)) {
        let rest = PUPPET.skeleton.rest_positions();
        let expected = reference::forward_kinematics(rest, motion.values());
        let got = PUPPET.skeleton.pose(&motion);
        for joint in Joint::ALL {
            let want = expected[joint.index()];
            let moved = far(want.translation, got.position(joint));
            prop_assert!(moved < MICROMETRES, "{} is {} m off", joint.name(), moved);
            for axis in 0..3 {
                let column: Vec3 = got.person_from_joint[joint.index()].matrix3.col(axis).into();
                let want = reference::transpose(want.rotation)[axis];
                prop_assert!(far(want, column) < 1e-5, "{} is turned otherwise", joint.name());
            }
        }
    }

    #[test]
    fn skinning_transforms_blend_vertices_as_lbs_in_f64(motion in motions(1.0)) {
        let puppet = &*PUPPET;
        let rest = puppet.skeleton.rest_positions();
        let joints = reference::forward_kinematics(rest, motion.values());
        let shape: Vec<V3> = puppet.template.vertices().iter().map(|v| reference::wide(*v)).collect();
        let expected = reference::skin(&puppet.template, &shape, &reference::posed_from_rest(rest, &joints));
        let mut transforms = SkinningTransforms::default();
        puppet.skeleton.skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        for (vertex, want) in expected.iter().enumerate() {
            let skin = puppet.template.skin()[vertex];
            let at = puppet.template.vertices()[vertex];
            let mut got = Vec3::ZERO;
            for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                let joint = Joint::ALL[usize::from(*joint)];
                got += weight * transforms.posed_from_rest(joint).transform_point3(at);
            }
            let moved = far(*want, got);
            prop_assert!(moved < MICROMETRES, "vertex {} is {} m off", vertex, moved);
        }
    }

    #[test]
    fn the_graphs_skinning_matrix_has_the_documented_planes(motion in motions(1.0)) {
        // Row 3 * column + row, joint across: read without the accessor that wrote it.
        let puppet = &*PUPPET;
        let rest = puppet.skeleton.rest_positions();
        let joints = reference::forward_kinematics(rest, motion.values());
        let mut transforms = SkinningTransforms::default();
        puppet.skeleton.skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        for (joint, want) in reference::posed_from_rest(rest, &joints).iter().enumerate() {
            for row in 0..3 {
                for column in 0..4 {
                    let expected = if column < 3 { want.rotation[row][column] } else { want.translation[row] };
                    let got = f64::from(transforms.0[(3 * column + row) * JOINTS + joint]);
                    prop_assert!((got - expected).abs() < 1e-5, "joint {} row {} column {}", joint, row, column);
                }
            }
        }
    }

    #[test]
    fn gaussians_follow_a_deformed_mesh_as_in_f64(motion in motions(0.8), seed in any::<u64>()) {
        let puppet = &*PUPPET;
        let posed = reference::posed_mesh(&puppet.template, puppet.skeleton.rest_positions(), &puppet.mesh, motion.values());
        // The same rounded mesh for both, so that the map alone is compared.
        let planes = planar(&posed);
        let count = posed.len();
        let rounded: Vec<V3> = (0..count)
            .map(|v| [0, 1, 2].map(|axis| f64::from(planes[axis * count + v])))
            .collect();
        let mut random = Random::new(seed);
        let residuals: Vec<f32> = (0..ATTRIBUTES * puppet.gaussians.len()).map(|_| random.signed() * 0.05).collect();
        let by_gaussian: Vec<[f64; ATTRIBUTES]> = (0..puppet.gaussians.len())
            .map(|i| std::array::from_fn(|plane| f64::from(residuals[plane * puppet.gaussians.len() + i])))
            .collect();
        let root = motion.root_translation;
        let mut got = GaussianSet::zeroed(puppet.gaussians.len());
        let mesh = PlanarVertices::new(&planes, count).expect("three planes");
        for residual in [None, Some(())] {
            puppet.gaussians.pose(mesh, residual.map(|()| &residuals[..]), root, &mut got).expect("sizes fit");
            let expected = reference::gaussians_on_mesh(
                &puppet.template,
                &puppet.gaussians,
                &rounded,
                residual.map(|()| &by_gaussian[..]),
                reference::wide(root),
            );
            check_gaussians(&expected, &got);
        }
    }

    #[test]
    fn a_rigid_motion_of_the_mesh_moves_gaussians_rigidly(axis in prop::array::uniform3(-3.0f32..3.0), shift in prop::array::uniform3(-2.0f32..2.0)) {
        let puppet = &*PUPPET;
        let motion = Affine3A::from_rotation_translation(Quat::from_scaled_axis(Vec3::from_array(axis)), Vec3::from_array(shift));
        let turn = Quat::from_scaled_axis(Vec3::from_array(axis));
        let moved: Vec<V3> = puppet.template.vertices().iter()
            .map(|v| reference::wide(motion.transform_point3(*v)))
            .collect();
        let planes = planar(&moved);
        let mesh = PlanarVertices::new(&planes, moved.len()).expect("three planes");
        let mut got = GaussianSet::zeroed(puppet.gaussians.len());
        puppet.gaussians.pose(mesh, None, Vec3::ZERO, &mut got).expect("sizes fit");
        let rest = at_rest(&puppet.gaussians);
        for i in 0..got.len() {
            let expected = motion.transform_point3(rest.positions[i]);
            // f32 positions a few metres out, through the frame of a triangle of a centimetre.
            prop_assert!(expected.distance(got.positions[i]) < 1e-5, "Gaussian {} left the body", i);
            let turned = (turn * rest.rotations[i]).dot(got.rotations[i]).abs();
            prop_assert!(turned > 1.0 - 1e-5, "Gaussian {} did not turn along", i);
            prop_assert_eq!(rest.log_scales[i], got.log_scales[i], "Gaussian {} changed its size", i);
        }
    }
}

/// The Gaussians on the undeformed template.
fn at_rest(gaussians: &BoundGaussians) -> GaussianSet {
    let template = &PUPPET.template;
    let planes: Vec<f32> = (0..3)
        .flat_map(|axis| template.vertices().iter().map(move |v| v[axis]))
        .collect();
    let mesh = PlanarVertices::new(&planes, template.vertices().len()).expect("three planes");
    let mut out = GaussianSet::zeroed(gaussians.len());
    gaussians
        .pose(mesh, None, Vec3::ZERO, &mut out)
        .expect("sizes fit");
    out
}

#[test]
fn binding_and_posing_at_rest_gives_the_gaussians_back() {
    let puppet = &*PUPPET;
    let bound = BoundGaussians::bind(
        &puppet.template,
        &puppet.at_rest,
        puppet.gaussians.triangles().to_vec(),
        puppet.gaussians.barycentrics().to_vec(),
    )
    .expect("the puppet's Gaussians bind");
    let got = at_rest(&bound);
    for i in 0..got.len() {
        let moved = got.positions[i].distance(puppet.at_rest.positions[i]);
        assert!(moved < 1e-6, "Gaussian {i} moved by {moved} m");
        let turned = got.rotations[i].dot(puppet.at_rest.rotations[i]).abs();
        assert!(turned > 1.0 - 1e-6, "Gaussian {i} turned: {turned}");
    }
    assert_eq!(got.log_scales, puppet.at_rest.log_scales, "sizes");
    assert_eq!(got.colours, puppet.at_rest.colours, "colours");
    assert_eq!(
        got.opacity_logits, puppet.at_rest.opacity_logits,
        "opacities"
    );
}

#[test]
fn packing_moves_a_gaussian_by_less_than_twenty_micrometres() {
    let full = BoundGaussians::bind(
        &PUPPET.template,
        &PUPPET.at_rest,
        PUPPET.gaussians.triangles().to_vec(),
        PUPPET.gaussians.barycentrics().to_vec(),
    )
    .expect("the puppet's Gaussians bind");
    let (before, after) = (at_rest(&full), at_rest(&full.clone().quantised()));
    let moved = (before.positions.iter().zip(&after.positions)).map(|(a, b)| a.distance(*b));
    let worst = moved.fold(0.0, f32::max);
    println!(
        "half precision moves a Gaussian by at most {:.1} um",
        worst * 1e6
    );
    assert!(worst < 2e-5, "{worst} m");
}

#[test]
fn a_collapsed_triangle_keeps_its_gaussians_finite() {
    let count = PUPPET.template.vertices().len();
    let planes = vec![0.5; 3 * count];
    let mesh = PlanarVertices::new(&planes, count).expect("three planes");
    let mut out = GaussianSet::zeroed(PUPPET.gaussians.len());
    PUPPET
        .gaussians
        .pose(mesh, None, Vec3::ZERO, &mut out)
        .expect("sizes fit");
    for (position, rotation) in out.positions.iter().zip(&out.rotations) {
        assert!(
            position.is_finite() && rotation.is_normalized(),
            "{position} {rotation}"
        );
    }
}

#[test]
fn every_motion_parameter_reaches_the_joint_it_is_named_for() {
    // Turning one joint by hand moves exactly the joints below it.
    for turned in Joint::ALL {
        let mut values = [0.0; PARAMS];
        let at = MotionParams::offset_of(turned);
        values[at..at + 3].copy_from_slice(&[0.3, -0.2, 0.4]);
        let pose = PUPPET.skeleton.pose(&MotionParams::new(values, Vec3::ZERO));
        for joint in Joint::ALL {
            let below = std::iter::successors(joint.parent(), |j| j.parent()).any(|j| j == turned);
            let rest = PUPPET.skeleton.rest_positions()[joint.index()];
            let moved = pose.position(joint).distance(rest) > 1e-4;
            assert_eq!(moved, below, "{} as {} turns", joint.name(), turned.name());
        }
    }
}
