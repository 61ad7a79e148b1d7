//! Gaussians between two states.

use crate::binding::{TURNED, matrix_distance};
use crate::person::{PUPPET, Pose, mesh_of};
use renderer_splat::gaussian::Gaussian;
use renderer_splat::posing::{DetailLevel, Poser};
use synthetic_person::hostile::inflated;
use synthetic_person::reference::{self as reference, M3};
use test_support::vulkan::{assert_silent, gpu};

/// From one rotation to another about a fixed axis, by way of matrices: `share` 0..=2. Also the angle between them.
fn turn_on(from: M3, to: M3, share: f64) -> (M3, f64) {
    let between = reference::mul(to, reference::transpose(from));
    let axis = [
        between[2][1] - between[1][2],
        between[0][2] - between[2][0],
        between[1][0] - between[0][1],
    ];
    let trace = between[0][0] + between[1][1] + between[2][2];
    let twice_sine = reference::norm(axis);
    let angle = twice_sine.atan2(trace - 1.0);
    if twice_sine == 0.0 {
        return (from, angle);
    }
    let turn = reference::rodrigues(reference::scale(axis, angle * share / twice_sine));
    (reference::mul(turn, from), angle)
}

fn matrix(gaussian: &Gaussian) -> M3 {
    reference::quaternion_matrix(gaussian.rotation.map(f64::from))
}

fn assert_between(from: &Gaussian, to: &Gaussian, share: f64, got: &Gaussian) -> f64 {
    let mix = |a: f32, b: f32| f64::from(a) + (f64::from(b) - f64::from(a)) * share;
    for axis in 0..3 {
        let want = mix(from.position[axis], to.position[axis]);
        let moved = (want - f64::from(got.position[axis])).abs();
        assert!(moved < 2e-6, "{moved} m off");
        let want = mix(from.scale[axis].log2(), to.scale[axis].log2());
        let grown = (want - f64::from(got.scale[axis]).log2()).abs();
        assert!(grown < 0.5 / 2048.0 + 2e-5, "{grown} octaves off");
        let want = mix(from.colour[axis], to.colour[axis]).max(0.0);
        let tinted = (want - f64::from(got.colour[axis])).abs();
        assert!(tinted <= want * 5e-4 + 7e-5, "{tinted} off in colour");
    }
    let opacity = mix(from.opacity, to.opacity).clamp(0.0, 1.0);
    let faded = (opacity - f64::from(got.opacity)).abs();
    assert!(faded < 0.5 / 65_535.0 + 2e-6, "{faded} off in opacity");
    let (want, angle) = turn_on(matrix(from), matrix(to), share);
    // Near half a turn either way round is the shortest.
    if angle < 3.1 {
        let turned = matrix_distance(want, got.rotation);
        assert!(turned < TURNED, "{turned} off after a turn of {angle}");
    }
    angle
}

#[test]
fn gaussians_move_between_states_as_in_f64_and_beyond_them() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    // Far apart: limbs turn by radians, more than any frame does.
    let poses = [21, 22].map(|seed| Pose::random(puppet, seed));
    let [from, to] = poses.map(|pose| poser.push_state(&pose.input()).expect("a pose"));
    let ends = [from, to].map(|id| {
        let state = poser.state(id).expect("a state");
        state.iter().map(|packed| packed.unpacked()).collect()
    });
    let [first, last]: [Vec<Gaussian>; 2] = ends;
    for share in [0.0f32, 0.001, 0.25, 0.5, 0.9, 1.0, 1.5, 2.0] {
        let got = poser.interpolate(from, to, share).expect("two states");
        let mut widest = 0.0f64;
        for ((first, last), got) in first.iter().zip(&last).zip(&got) {
            let angle = assert_between(first, last, f64::from(share), &got.unpacked());
            widest = widest.max(angle);
        }
        assert!(widest > 2.0, "turns of up to {widest} radians are tried");
    }
    assert_silent(&gpu);
}

#[test]
fn small_turns_are_as_exact_as_large_ones() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let mut motion = synthetic_person::Random::new(31).motion(0.5);
    let before = Pose::of(puppet, &motion);
    for joint in spmm3::Joint::ALL {
        let turned = motion.axis_angle(joint) + glam::Vec3::new(3e-4, -2e-4, 1e-4);
        motion.set_axis_angle(joint, turned);
    }
    let after = Pose::of(puppet, &motion);
    let from = poser.push_state(&before.input()).expect("a pose");
    let to = poser.push_state(&after.input()).expect("a pose");
    let [first, last] = [from, to].map(|id| poser.state(id).expect("a state"));
    for share in [0.3, 1.7] {
        let got = poser.interpolate(from, to, share).expect("two states");
        for ((first, last), got) in first.iter().zip(&last).zip(&got) {
            let (first, last) = (first.unpacked(), last.unpacked());
            let angle = assert_between(&first, &last, f64::from(share), &got.unpacked());
            assert!(angle < 0.05, "a turn of {angle} radians");
        }
    }
}

#[test]
fn between_equal_states_nothing_moves() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let pose = Pose::random(puppet, 41);
    let from = poser.push_state(&pose.input()).expect("a pose");
    let to = poser.push_state(&pose.input()).expect("a pose");
    let state = poser.state(from).expect("a state");
    assert!(
        state == poser.state(to).expect("a state"),
        "one pose, twice"
    );
    for share in [0.0, 0.37, 1.0, 1.5] {
        for (from, to) in [(from, to), (from, from)] {
            let got = poser.interpolate(from, to, share).expect("two states");
            for (want, got) in state.iter().zip(&got) {
                if want == got {
                    continue;
                }
                // Of two numbers alike in size, packing may leave out either: the same rotation all the same.
                let (want, got) = (want.unpacked(), got.unpacked());
                assert_eq!(want.position, got.position, "position at {share}");
                assert_eq!(want.scale, got.scale, "scale at {share}");
                assert_eq!(want.opacity, got.opacity, "opacity at {share}");
                assert_eq!(want.colour, got.colour, "colour at {share}");
                let turned = matrix_distance(matrix(&want), got.rotation);
                assert!(turned < TURNED, "{turned} at {share}");
            }
        }
    }
}

#[test]
fn shares_that_are_out_of_range_are_held_at_its_ends() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let [from, to] = [51, 52].map(|seed| {
        let pose = Pose::random(puppet, seed);
        poser.push_state(&pose.input()).expect("a pose")
    });
    for (share, held) in [(-1.0, 0.0), (3.0, 2.0), (f32::NAN, 1.0)] {
        let got = poser.interpolate(from, to, share).expect("two states");
        let want = poser.interpolate(from, to, held).expect("two states");
        assert!(got == want, "{share} is as {held}");
    }
}

#[test]
fn a_level_of_detail_holds_the_gaussians_of_its_list_grown() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let third: Vec<u32> = (0u32..2_000).step_by(3).collect();
    let levels = [
        DetailLevel {
            kept: &third,
            log2_growth: &vec![0.5; third.len()],
        },
        DetailLevel {
            kept: &[7, 1_999, 3],
            log2_growth: &[0.0; 3],
        },
    ];
    let mesh = mesh_of(puppet).with_levels(&levels).expect("its own");
    let mut poser = Poser::new(&gpu, &mesh).expect("the puppet fits");
    let [from, to] = [53, 54].map(|seed| {
        let pose = Pose::random(puppet, seed);
        poser.push_state(&pose.input()).expect("a pose")
    });
    let all = poser.interpolate(from, to, 0.3).expect("two states");
    let grown = poser.interpolate_level(from, to, 0.3, 1).expect("a level");
    assert_eq!(grown.len(), third.len(), "a third");
    for (got, index) in grown.iter().zip(&third) {
        let (got, want) = (got.unpacked(), all[*index as usize].unpacked());
        assert_eq!(got.position, want.position, "place of {index}");
        assert_eq!(got.colour, want.colour, "colour of {index}");
        for (got, want) in got.scale.iter().zip(want.scale) {
            let growth = (got / want).log2();
            assert!((growth - 0.5).abs() < 1e-3, "{index} grew by {growth}");
        }
    }
    let few: Vec<_> = [7, 1_999, 3].map(|index: usize| all[index]).into();
    for level in [2, 9] {
        let got = poser.interpolate_level(from, to, 0.3, level);
        assert!(got.expect("the last level") == few, "level {level}");
    }
    assert!(
        poser.interpolate(from, to, 0.3).expect("two states") == all,
        "all again"
    );
    assert_silent(&gpu);
}

#[test]
fn the_device_holds_gaussians_at_the_largest_size_of_a_person() {
    let Some(gpu) = gpu() else { return };
    let mut puppet = synthetic_person::Puppet::small();
    puppet.gaussians = inflated(&puppet.template, &puppet.gaussians, 3.0);
    let mut poser = Poser::new(&gpu, &mesh_of(&puppet)).expect("the puppet fits");
    let pose = Pose::random(&puppet, 41);
    let from = poser.push_state(&pose.input()).expect("a pose");
    for gaussian in poser.interpolate(from, from, 0.5).expect("two states") {
        for metres in gaussian.unpacked().scale {
            assert!((metres - spmm3::MOST_SCALE).abs() < 1e-3, "{metres} m");
        }
    }
    assert_silent(&gpu);
}
