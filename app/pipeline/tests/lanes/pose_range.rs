//! What networks see of a motion that is unlike all they have learnt from.

use crate::stage::{CPU, avatar};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::inference::Inference;
use glam::Vec3;
use spmm3::networks::GraphParts;
use spmm3::{Avatar, Joint, MotionParams, PoseRange, SkinningTransforms};
use std::sync::Arc;
use test_support::onnx;

/// A fold of the left arm.
fn folded(angle: f32) -> MotionParams {
    let mut motion = MotionParams::default();
    motion.set_axis_angle(Joint::LeftElbow, Vec3::new(0.0, angle, 0.0));
    motion
}

#[test]
fn networks_see_the_nearest_pose_of_their_range_and_the_skeleton_the_motion_itself() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let plain = avatar();
    let range = PoseRange::of([&folded(-0.2), &folded(0.3)]).expect("two poses");
    let limited = Avatar {
        pose_range: Some(range),
        ..plain.clone()
    };
    // What a graph gives for a motion's networks on another motion's skeleton: vertices, then residuals.
    let results = |avatar: &Avatar, networks: &MotionParams, skeleton: &MotionParams| {
        let mut transforms = SkinningTransforms::default();
        let joints = avatar.skeleton.pose(skeleton);
        avatar.skeleton.skinning(&joints, &mut transforms);
        let shared = Arc::new(avatar.clone());
        let mut inference = Inference::open(
            &runtime,
            &shared,
            GraphParts::Whole,
            &[CPU],
            &CompiledSources::default(),
        )
        .expect("a session");
        let mut outputs = inference.outputs().expect("memory");
        inference
            .run(networks, &transforms, &mut outputs)
            .expect("it runs");
        [0, 1].map(|output| outputs.get(output).to_vec())
    };
    let [far, edge, within] = [1.4, 0.3, 0.1].map(folded);
    let shown = results(&limited, &far, &far);
    assert_eq!(shown, results(&plain, &edge, &far), "the range's edge");
    let whole = results(&plain, &far, &far);
    assert_ne!(shown[1], whole[1], "residuals that the range leaves out");
    assert_ne!(
        shown[0],
        results(&plain, &edge, &edge)[0],
        "the skeleton moves on"
    );
    assert_eq!(
        results(&limited, &within, &within),
        results(&plain, &within, &within),
        "within the range"
    );
}
