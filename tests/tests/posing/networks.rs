//! The networks on ONNX Runtime and all the rest on the device, against the whole graph and the CPU's F_m2g.

use glam::{Quat, Vec3};
use renderer_splat::posing::Poser;
use spmm3::networks::GraphParts;
use spmm3::{GaussianSet, PlanarVertices, SkinningTransforms};
use synthetic_person::{Puppet, Random};
use test_support::bound_person::{Networks, avatar_mesh, session};
use test_support::onnx::runtime;
use test_support::vulkan::{assert_silent, gpu};

#[test]
fn networks_alone_and_the_device_pose_as_the_whole_graph_and_the_cpu_do() {
    let (Some(gpu), Some(runtime)) = (gpu(), runtime()) else {
        return;
    };
    let avatar = Puppet::small().avatar();
    let mut networks = Networks::new(&runtime, &avatar);
    let mut whole = session(&runtime, &avatar, GraphParts::Whole);
    let mut outputs = whole.outputs().expect("memory for them");
    let mut poser = Poser::new(&gpu, &avatar_mesh(&avatar)).expect("the puppet fits");
    let mut want = GaussianSet::zeroed(avatar.gaussians.len());
    for seed in 100..104 {
        let motion = Random::new(seed).motion(0.6);
        let id = poser
            .push_state(&networks.pose(&avatar, &motion))
            .expect("one avatar's");
        let state = poser.state(id).expect("a state");
        let mut skinning = SkinningTransforms::default();
        let joints = avatar.skeleton.pose(&motion);
        avatar.skeleton.skinning(&joints, &mut skinning);
        whole.input_mut(0).copy_from_slice(motion.values());
        whole.input_mut(1).copy_from_slice(&skinning.0);
        whole.run(&mut outputs).expect("the graph runs");
        let vertices = avatar.template.vertices().len();
        let posed = PlanarVertices::new(outputs.get(0), vertices).expect("three planes");
        let (residuals, root) = (Some(outputs.get(1)), motion.root_translation);
        avatar
            .gaussians
            .pose(posed, residuals, root, &mut want)
            .expect("one avatar's");
        for (index, got) in state.iter().enumerate() {
            let got = got.unpacked();
            let moved = want.positions[index].distance(Vec3::from(got.position));
            assert!(moved < 1e-5, "Gaussian {index} is {moved} m off");
            let cosine = want.rotations[index].dot(Quat::from_array(got.rotation));
            assert!(1.0 - cosine.abs() < 1e-5, "Gaussian {index}: {cosine}");
            for axis in 0..3 {
                let grown = want.log_scales[index][axis] - got.scale[axis].ln();
                assert!(grown.abs() < 3e-4, "Gaussian {index} grew by {grown}");
            }
            let opacity = 1.0 / (1.0 + (-want.opacity_logits[index]).exp());
            let faded = (opacity - got.opacity).abs();
            assert!(faded < 1e-4, "Gaussian {index} faded by {faded}");
        }
    }
    assert_silent(&gpu);
}
