//! The simulation on the tube person.

use super::{Collider, Fabric, PoseSampler, Simulator};
use crate::synthetic::puppet;
use glam::Vec3;
use spmm3::{Expressions, Joint, MotionParams};

#[test]
fn cloth_settles_lower_in_energy_and_outside_the_body() {
    let puppet = puppet();
    let simulator = Simulator::new(&puppet);
    let faces = Expressions::new();
    let mut sampler = PoseSampler::new(1, &faces, 1);
    for _ in 0..10 {
        let motion = sampler.sample();
        let skin = simulator.skin(&motion);
        let posed = skin.pose_all(&puppet.template, puppet.template.vertices());
        let normals = simulator.surface().normals(&posed);
        // Without a body to lean on, no work is done on the cloth from outside.
        let free =
            simulator
                .garment()
                .settle(&posed, &normals, &Collider::new(vec![], vec![]), &[]);
        assert!(
            free.energy[1] <= free.energy[0],
            "energy rose: {:?}",
            free.energy
        );
        let settled = simulator.hang(&motion, &posed);
        assert!(
            settled.residual < 1e-3,
            "still moving {} m a step",
            settled.residual
        );
        let body: Vec<usize> = (0..posed.len())
            .filter(|v| puppet.fabric[*v] == Fabric::Skin)
            .collect();
        let pick = |values: &[Vec3]| body.iter().map(|v| values[*v]).collect();
        let collider = Collider::new(pick(&posed), pick(&normals));
        for (v, at) in settled.vertices.iter().zip(&settled.positions) {
            // The rim is sewn on: it moves with the skin alone.
            if puppet.looseness[*v as usize] <= 0.0 {
                continue;
            }
            if let Some((point, normal)) = collider.nearest(*at) {
                let depth = (point - *at).dot(normal);
                assert!(
                    depth < 0.008,
                    "vertex {v} at rest {} is {depth} m inside the body",
                    puppet.template.vertices()[*v as usize]
                );
            }
        }
    }
}

#[test]
fn a_bent_trunk_lets_the_open_front_hang() {
    let puppet = puppet();
    let simulator = Simulator::new(&puppet);
    let mut motion = MotionParams::default();
    motion.set_axis_angle(Joint::Spine1, Vec3::new(1.0, 0.0, 0.0));
    let truth = simulator.simulate(&motion);
    let linear = simulator
        .skin(&motion)
        .pose_linear(puppet.template.vertices());
    let drop: f32 = (0..linear.len())
        .filter(|v| puppet.looseness[*v] > 0.02 && puppet.template.vertices()[*v].y > 1.1)
        .filter(|v| puppet.template.vertices()[*v].z > 0.05)
        .map(|v| linear[v].y - truth.posed[v].y)
        .fold(0.0, f32::max);
    assert!(drop > 0.004, "the front hangs {drop} m lower only");
}

#[test]
fn offsets_carry_the_canonical_shape_to_the_simulated_one() {
    let puppet = puppet();
    let simulator = Simulator::new(&puppet);
    let faces = Expressions::new();
    let mut sampler = PoseSampler::new(2, &faces, 1);
    for _ in 0..5 {
        let motion = sampler.sample();
        let truth = simulator.simulate(&motion);
        assert_eq!(truth.clamped, 0, "spikes on a plain tube");
        let mut transforms = spmm3::SkinningTransforms::default();
        puppet
            .skeleton
            .skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        let smile = f64::from(motion.expression()[0]);
        for (v, rest) in puppet.template.vertices().iter().enumerate() {
            // Linear blending in f64, written out.
            let canonical: Vec<f64> = (0..3)
                .map(|k| {
                    f64::from(rest[k])
                        + smile * f64::from(puppet.expressions[0][v][k])
                        + f64::from(truth.offsets[v][k])
                })
                .collect();
            for row in 0..3 {
                let mut sum = 0.0;
                for (joint, weight) in puppet.template.skin()[v].dense().iter().enumerate() {
                    let at =
                        |column: usize| f64::from(transforms.0[(3 * column + row) * 55 + joint]);
                    let moved =
                        at(0) * canonical[0] + at(1) * canonical[1] + at(2) * canonical[2] + at(3);
                    sum += f64::from(*weight) * moved;
                }
                assert!(
                    (sum - f64::from(truth.posed[v][row])).abs() < 2e-6,
                    "vertex {v} is off"
                );
            }
        }
    }
}

#[test]
fn a_small_step_of_the_pose_is_a_small_step_of_the_cloth() {
    let puppet = puppet();
    let simulator = Simulator::new(&puppet);
    let at = |angle: f32| {
        let mut motion = MotionParams::default();
        motion.set_axis_angle(Joint::Spine2, Vec3::new(angle, 0.0, 0.0));
        simulator.simulate(&motion).posed
    };
    let (before, after) = (at(0.4), at(0.41));
    let jump = before
        .iter()
        .zip(&after)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max);
    assert!(jump < 0.02, "the cloth jumps {jump} m");
}

#[test]
fn one_seed_gives_one_sequence_and_the_root_never_turns() {
    let faces = Expressions::new();
    let mut first = PoseSampler::new(7, &faces, 4);
    let mut second = PoseSampler::new(7, &faces, 4);
    let mut other = PoseSampler::new(8, &faces, 4);
    let mut differs = false;
    for _ in 0..50 {
        let pose = first.sample();
        assert_eq!(
            pose,
            second.sample(),
            "the same seed must give the same pose"
        );
        differs |= pose != other.sample();
        assert_eq!(
            pose.axis_angle(Joint::Pelvis),
            Vec3::ZERO,
            "the root turned"
        );
        assert!(pose.is_finite(), "a pose is not finite");
    }
    assert!(differs, "another seed must give other poses");
}

#[test]
fn knees_and_elbows_bend_in_their_own_direction() {
    let faces = Expressions::new();
    let mut sampler = PoseSampler::new(3, &faces, 0);
    for _ in 0..200 {
        let pose = sampler.sample();
        for knee in [Joint::LeftKnee, Joint::RightKnee] {
            assert!(pose.axis_angle(knee).x >= 0.0, "a knee bends forwards");
        }
        let (left, right) = (
            pose.rotation(Joint::LeftElbow),
            pose.rotation(Joint::RightElbow),
        );
        assert!((left * Vec3::X).z > -0.3, "the left elbow bends backwards");
        assert!(
            (right * Vec3::NEG_X).z > -0.3,
            "the right elbow bends backwards"
        );
    }
}
