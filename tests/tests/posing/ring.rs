//! Which states are kept.

use crate::person::{PUPPET, Pose, driven_mesh_of, mesh_of};
use renderer_splat::error::RenderError;
use renderer_splat::posing::{Deformation, PosedInput, Poser};
use test_support::vulkan::gpu;

#[test]
fn a_state_is_kept_until_four_more_are_pushed() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mesh = mesh_of(puppet);
    let mut poser = Poser::new(&gpu, &mesh).expect("the puppet fits");
    let poses: Vec<Pose> = (60..63).map(|seed| Pose::random(puppet, seed)).collect();
    let first = poser.push_state(&poses[0].input()).expect("a pose");
    let alone = poser.state(first).expect("a state");
    for pose in [1, 2, 1] {
        poser.push_state(&poses[pose].input()).expect("a pose");
    }
    assert!(
        poser.state(first).expect("still there") == alone,
        "others were made since"
    );
    let again = poser.push_state(&poses[0].input()).expect("a pose");
    assert!(
        poser.state(again).expect("a state") == alone,
        "the same pose in the first one's place"
    );
    let gone = poser.state(first).expect_err("overwritten");
    assert!(matches!(gone, RenderError::NoState), "{gone}");
    let gone = poser.interpolate(first, again, 0.5).expect_err("likewise");
    assert!(matches!(gone, RenderError::NoState), "{gone}");
    let mut other = Poser::new(&gpu, &mesh).expect("the puppet fits");
    let missing = other.state(again).expect_err("nothing was pushed");
    assert!(missing.to_string().contains("push a pose"), "{missing}");
}

#[test]
fn a_pose_of_another_size_is_refused() {
    let Some(gpu) = gpu() else { return };
    let puppet = &*PUPPET;
    let mut poser = Poser::new(&gpu, &mesh_of(puppet)).expect("the puppet fits");
    let pose = Pose::random(puppet, 70);
    let good = pose.input();
    let computed = |canonical_vertices, potentials| PosedInput {
        deformation: Deformation::Computed {
            canonical_vertices,
            potentials,
        },
        ..good
    };
    let cases = [
        (
            computed(&pose.canonical[1..], &pose.potentials),
            "canonical",
        ),
        (
            PosedInput {
                skinning: &[0.0; 12],
                ..good
            },
            "12 skinning",
        ),
        (computed(&pose.canonical, &[]), "0 potentials"),
        (pose.driven(), "no networks"),
    ];
    for (input, expected) in cases {
        let error = poser.push_state(&input).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
    let mut poser = Poser::new(&gpu, &driven_mesh_of(puppet)).expect("the puppet fits");
    let few = PosedInput {
        deformation: Deformation::Parameters(&pose.parameters[1..]),
        ..good
    };
    let error = poser.push_state(&few).expect_err("too few");
    assert!(error.to_string().contains("214 parameters"), "{error}");
}
