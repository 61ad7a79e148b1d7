//! The CPU's kernels on the real demo avatar, against ONNX Runtime's operators and `spmm3`'s plain F_m2g.

use app_kernels::state::{GaussianState, plane};
use app_kernels::{Attributes, PoseInputs, Poser, Skinner};
use glam::{Quat, Vec3};
use npu_runtime::{Provider, Runtime, Session, TensorSpec};
use spmm3::networks::{Dialect, GraphParts, Port};
use spmm3::{Avatar, GaussianSet, MotionParams, PlanarVertices, SH_C0, SkinningTransforms};
use synthetic_person::Random;

fn run(
    runtime: &Runtime,
    avatar: &Avatar,
    parts: GraphParts,
    motion: &MotionParams,
    transforms: &SkinningTransforms,
) -> (Vec<f32>, Vec<f32>) {
    let ports = parts.ports(&avatar.graph_sizes().expect("our graph"));
    let spec = |(name, shape): &Port| TensorSpec::new(name, shape);
    let mut session = Session::new(
        runtime,
        &avatar
            .graph(parts, Dialect::Package)
            .expect("the networks come back"),
        Provider::Cpu { threads: 2 },
        &ports.inputs.iter().map(spec).collect::<Vec<_>>(),
        &ports.outputs.iter().map(spec).collect::<Vec<_>>(),
    )
    .expect("ONNX Runtime takes the graph");
    session.input_mut(0).copy_from_slice(motion.values());
    if parts != GraphParts::Networks {
        session.input_mut(1).copy_from_slice(&transforms.0);
    }
    let mut outputs = session.outputs().expect("memory for them");
    session.run(&mut outputs).expect("the graph runs");
    (outputs.get(0).to_vec(), outputs.get(1).to_vec())
}

/// Holds every placement's way to a state against the plain one.
pub(crate) fn every_placement_poses_it_alike(avatar: &Avatar, runtime: &Runtime) {
    let motion = Random::new(11).motion(0.3);
    let root = Vec3::new(0.3, 0.1, -0.7);
    let mut transforms = SkinningTransforms::default();
    avatar
        .skeleton
        .skinning(&avatar.skeleton.pose(&motion), &mut transforms);
    let outputs = |parts| run(runtime, avatar, parts, &motion, &transforms);
    let (vertices, residuals) = outputs(GraphParts::Whole);
    let (canonical, potentials) = outputs(GraphParts::Networks);

    let count = avatar.gaussians.len();
    let mut plain = GaussianSet::zeroed(count);
    let mesh = PlanarVertices::new(&vertices, vertices.len() / 3).expect("three planes");
    avatar
        .gaussians
        .pose(mesh, Some(&residuals), root, &mut plain)
        .expect("the sizes fit");

    let mut skinned = vec![f32::NAN; vertices.len()];
    Skinner::new(&avatar.template)
        .skin(&canonical, &transforms, &mut skinned)
        .expect("the sizes fit");
    let apart = skinned.iter().zip(&vertices).map(|(a, b)| (a - b).abs());
    let worst = apart.fold(0.0f32, f32::max);
    println!("skinning: {:.4} mm", worst * 1e3);
    assert!(worst < 2e-5, "a skinned vertex is {worst} m off");

    let poser = Poser::with_tail(avatar).expect("F_attr comes back");
    for (name, vertices, attributes) in [
        ("npu", &vertices, Attributes::Residuals(&residuals)),
        ("cpu-tail", &vertices, Attributes::Potentials(&potentials)),
        (
            "all on the CPU",
            &skinned,
            Attributes::Potentials(&potentials),
        ),
    ] {
        let mut state = GaussianState::new(count);
        let inputs = PoseInputs {
            vertices,
            attributes,
            root,
        };
        poser
            .pose(&inputs, 0..count, None, &mut state)
            .expect("the inputs fit");
        // Metres, 1 - |cosine|, octaves, opacity, colour.
        let mut worst = [0.0f32; 5];
        let at = |first: usize, i: usize| [0, 1, 2].map(|k| state.plane(first + k)[i]);
        let mut note = |which: usize, error: f32| {
            assert!(error.is_finite(), "{name}: figure {which} is {error}");
            worst[which] = worst[which].max(error);
        };
        for i in 0..count {
            let position = Vec3::from_array(at(plane::POSITION.start, i));
            note(0, position.distance(plain.positions[i]));
            let [x, y, z, w] = [0, 1, 2, 3].map(|k| state.plane(plane::ROTATION.start + k)[i]);
            let turned = Quat::from_xyzw(x, y, z, w).dot(plain.rotations[i]).abs();
            note(1, 1.0 - turned);
            let scale = Vec3::from_array(at(plane::LOG2_SCALE.start, i));
            let wanted = plain.log_scales[i] * std::f32::consts::LOG2_E;
            note(2, (scale - wanted).abs().max_element());
            let opacity = 1.0 / (1.0 + (-plain.opacity_logits[i]).exp());
            note(3, (state.plane(plane::OPACITY)[i] - opacity).abs());
            let colour = Vec3::from_array(at(plane::COLOUR.start, i));
            note(
                4,
                (colour - (plain.colours[i] * SH_C0 + 0.5))
                    .abs()
                    .max_element(),
            );
        }
        println!("{name}: {:?}", worst.map(|error| format!("{error:.1e}")));
        for (error, most) in worst.into_iter().zip([5e-5, 1e-5, 1e-4, 1e-4, 1e-4]) {
            assert!(error < most, "{name}: {worst:?}");
        }
    }
}
