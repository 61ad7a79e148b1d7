//! The package that a training hands out moves as the training's own numbers do, which are single precision.

use super::studio::{capture, motions, poses, puppet, stranger};
use crate::Trainer;
use crate::options::Options;
use capture::HeldOut;
use glam::Vec3;
use npu_runtime::{Provider, Session};
use spmm3::networks::{Dense, MeshNetwork};
use spmm3::{
    ATTRIBUTES, Avatar, BODY, EXPRESSION, GaussianSet, JOINTS, MotionParams, PARAMS,
    PlanarVertices, SkinningTransforms,
};
use test_support::onnx;

/// A layer written out in f64.
fn layer(layer: &Dense, inputs: &[f64], silu: bool) -> Vec<f64> {
    let mut sums: Vec<f64> = layer.bias().iter().map(|bias| f64::from(*bias)).collect();
    let rows = layer.weights().chunks_exact(layer.outputs());
    for (input, row) in inputs.iter().zip(rows) {
        for (sum, weight) in sums.iter_mut().zip(row) {
            *sum += input * f64::from(weight.to_f32());
        }
    }
    if silu {
        for sum in &mut sums {
            *sum /= 1.0 + (-*sum).exp();
        }
    }
    sums
}

/// The package's vertices in f64: F_mesh, then LBS joint by joint.
fn posed_vertices(avatar: &Avatar, motion: &MotionParams) -> Vec<Vec3> {
    let mesh = MeshNetwork::read(&avatar.deform_graph, &avatar.template).expect("F_mesh");
    let p: Vec<f64> = motion.values().iter().map(|x| f64::from(*x)).collect();
    let hidden = layer(&mesh.second, &layer(&mesh.first, &p, true), true);
    let code = layer(&mesh.code, &hidden, false);
    let fields = mesh.decoder.dequantise();
    let columns = mesh.decoder.mean().len();
    let count = columns / 3;
    let mut transforms = SkinningTransforms::default();
    let joints = avatar.skeleton.pose(motion);
    avatar.skeleton.skinning(&joints, &mut transforms);
    let vertex = |vertex: usize| {
        let place = [0, 1, 2].map(|axis| {
            let column = axis * count + vertex;
            let moved: f64 = (code.iter().enumerate())
                .map(|(rank, code)| code * f64::from(fields[rank * columns + column]))
                .sum();
            let rest = avatar.template.vertices()[vertex][axis];
            f64::from(rest) + f64::from(mesh.decoder.mean()[column]) + moved
        });
        let mut posed = [0.0f64; 3];
        let skin = avatar.template.skin()[vertex];
        for (joint, weight) in skin.joints.iter().zip(skin.weights) {
            for (row, posed) in posed.iter_mut().enumerate() {
                let at = |column: usize| {
                    f64::from(transforms.0[(3 * column + row) * JOINTS + usize::from(*joint)])
                };
                let moved = at(0) * place[0] + at(1) * place[1] + at(2) * place[2] + at(3);
                *posed += f64::from(weight) * moved;
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "metres")]
        Vec3::from_array(posed.map(|x| x as f32))
    };
    (0..count).map(vertex).collect()
}

/// Positions of the package's Gaussians as a receiver has them: ONNX Runtime's vertices and residuals, then F_m2g.
fn received(avatar: &Avatar, session: &mut Session, motion: &MotionParams) -> [Vec<Vec3>; 2] {
    let (vertices, gaussians) = (avatar.template.vertices().len(), avatar.gaussians.len());
    let joints = avatar.skeleton.pose(motion);
    let mut transforms = SkinningTransforms::default();
    avatar.skeleton.skinning(&joints, &mut transforms);
    session.input_mut(0).copy_from_slice(motion.values());
    session.input_mut(1).copy_from_slice(&transforms.0);
    let mut outputs = session.outputs().expect("memory");
    session.run(&mut outputs).expect("it runs");
    let planes = outputs.get(0);
    let posed =
        (0..vertices).map(|v| Vec3::from_array([0, 1, 2].map(|axis| planes[axis * vertices + v])));
    let mut set = GaussianSet::zeroed(gaussians);
    let root = motion.root_translation;
    assert_eq!(outputs.get(1).len(), ATTRIBUTES * gaussians, "residuals");
    (avatar.gaussians)
        .pose(
            PlanarVertices::new(planes, vertices).expect("planes"),
            Some(outputs.get(1)),
            root,
            &mut set,
        )
        .expect("posed");
    [posed.map(|vertex| vertex + root).collect(), set.positions]
}

/// The greatest distance, millimetres, of planes x|y|z from points.
fn furthest(planes: [&[f32]; 3], points: &[Vec3]) -> f32 {
    let apart = points.iter().enumerate().map(|(i, point)| {
        let place = Vec3::from_array(planes.map(|plane| plane[i]));
        1e3 * place.distance(*point)
    });
    apart.fold(0.0, f32::max)
}

#[test]
fn the_packages_vertices_and_gaussians_are_the_trainings_to_a_twentieth_of_a_millimetre() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = puppet();
    let capture = capture(folder.path(), &truth, 2, &motions(3), &HeldOut::default());
    let first = stranger(&truth);
    let options = Options {
        gaussians: 260,
        ..Options::default()
    };
    let frames = poses(&capture, &first);
    let mut trainer = Trainer::new(&capture, first, frames.clone(), options).expect("a training");
    let begun = trainer.parameters.clone();
    for step in 0..250u8 {
        trainer.step(f32::from(step) / 250.0).expect("a step");
    }
    let moved = |now: &[f32], before: &[f32]| {
        let moved = now
            .iter()
            .zip(before)
            .map(|(now, before)| (now - before).abs());
        moved.fold(0.0f32, f32::max)
    };
    let learnt = &trainer.parameters;
    assert!(
        moved(&learnt.mesh_mean, &begun.mesh_mean) > 1e-3,
        "the mesh was learnt"
    );
    assert!(
        moved(&learnt.mesh_fields, &begun.mesh_fields) > 1e-5,
        "and how it bends"
    );
    let path = folder.path().join("me.m3a");
    let avatar = trainer.avatar().expect("an avatar");
    avatar.save(&path).expect("written");
    let avatar = Avatar::load(&path).expect("read again");
    let number = avatar.gaussians.len();
    assert!((201..=260).contains(&number), "{number} Gaussians");
    let range = avatar.pose_range.as_ref().expect("what it was shown");
    let refined =
        (frames.iter().zip(&trainer.poses)).map(|(motion, pose)| pose.correction.applied(motion));
    let shown: Vec<MotionParams> = frames.iter().cloned().chain(refined).collect();
    let rotations = (0..BODY).chain(BODY + EXPRESSION..PARAMS);
    for (bound, at) in rotations.enumerate() {
        let of = |wider: fn(f32, f32) -> f32| {
            let values = shown.iter().map(|motion| motion.values()[at]);
            values.reduce(wider).expect("frames")
        };
        assert_eq!(range.low()[bound], of(f32::min), "the least of {at}");
        assert_eq!(range.high()[bound], of(f32::max), "the most of {at}");
    }
    let order = avatar.importance.as_ref().expect("an order of importance");
    let mut all = order.order().to_vec();
    all.sort_unstable();
    assert!(all.into_iter().eq((0..).take(number)), "of all Gaussians");
    assert!(order.heirs().is_some(), "with heirs, as `bake` writes it");

    let count = avatar.template.vertices().len();
    let (inputs, outputs) = onnx::whole_graph(count, number);
    let mut session = onnx::runtime().map(|runtime| {
        Session::new(
            &runtime,
            &avatar.deform_graph[..],
            Provider::Cpu { threads: 1 },
            &inputs,
            &outputs,
        )
        .expect("the package's graph")
    });
    let mut most = [0.0f32; 3];
    for motion in &frames {
        trainer
            .model
            .pose(&trainer.parameters, motion, None, &mut trainer.memory.posed)
            .expect("posed");
        let posed = &trainer.memory.posed;
        let [x, y, z] = [0, 1, 2].map(|axis| &posed.vertices()[axis * count..(axis + 1) * count]);
        let root = motion.root_translation;
        let written: Vec<Vec3> = (posed_vertices(&avatar, motion).into_iter())
            .map(|vertex| vertex + root)
            .collect();
        most[0] = most[0].max(furthest([x, y, z], &written));
        if let Some(session) = &mut session {
            let [vertices, gaussians] = received(&avatar, session, motion);
            most[1] = most[1].max(furthest([x, y, z], &vertices));
            let places = [0, 1, 2].map(|plane| posed.gaussians().plane(plane));
            most[2] = most[2].max(furthest(places, &gaussians));
        }
    }
    let [vertices, received, gaussians] = most;
    println!(
        "the package is off the training by {vertices:.4} mm at vertices, {received:.4} mm as ONNX Runtime has them, {gaussians:.4} mm at Gaussians"
    );
    assert!(vertices < 0.05 && received < 0.05, "{most:?} mm");
    // Offsets are half precision and bases 8 bits in a package.
    assert!(gaussians < 0.5, "{most:?} mm");
}
