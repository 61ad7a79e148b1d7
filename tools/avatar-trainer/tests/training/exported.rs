//! The package that a training hands out moves as the training saw it.

use crate::studio::{capture, model, motions, poses, puppet, stranger};
use avatar_gradient::Posed;
use avatar_trainer::{Options, Trainer};
use capture::HeldOut;
use glam::Vec3;
use spmm3::networks::{Dense, MeshNetwork};
use spmm3::{Avatar, GaussianSet, JOINTS, MotionParams, PlanarVertices, SkinningTransforms};

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
    for step in 0..250u8 {
        trainer.step(f32::from(step) / 250.0).expect("a step");
    }
    let path = folder.path().join("me.m3a");
    let avatar = trainer.avatar().expect("an avatar");
    avatar.save(&path).expect("written");
    let avatar = Avatar::load(&path).expect("read again");
    let number = avatar.gaussians.len();
    assert!((201..=260).contains(&number), "{number} Gaussians");
    let order = avatar.importance.as_ref().expect("an order of importance");
    let mut all = order.order().to_vec();
    all.sort_unstable();
    assert!(all.into_iter().eq((0..).take(number)), "of all Gaussians");
    assert!(order.heirs().is_some(), "with heirs, as `bake` writes it");
    let (networks, model) = model(&avatar);
    let parameters = networks.parameters();
    let mut posed = Posed::new();
    for motion in &frames {
        model
            .pose(&parameters, motion, None, &mut posed)
            .expect("posed");
        let expected = posed_vertices(&avatar, motion);
        let count = expected.len();
        let root = motion.root_translation;
        for (vertex, expected) in expected.iter().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|axis| posed.vertices()[axis * count + vertex]);
            let apart = 1e3 * Vec3::new(x, y, z).distance(*expected + root);
            assert!(apart < 0.05, "vertex {vertex}: {apart} mm");
        }
        // F_m2g as the receiver has it, from these vertices.
        let planes: Vec<f32> = (0..3)
            .flat_map(|axis| expected.iter().map(move |vertex| vertex[axis]))
            .collect();
        let residuals: Vec<f32> = (posed.local().iter())
            .zip(avatar.gaussians.attributes())
            .map(|(sum, template)| sum - template)
            .collect();
        let mut set = GaussianSet::zeroed(number);
        let vertices = PlanarVertices::new(&planes, count).expect("planes");
        avatar
            .gaussians
            .pose(vertices, Some(&residuals), root, &mut set)
            .expect("posed");
        for (i, place) in set.positions.iter().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|plane| posed.gaussians().plane(plane)[i]);
            let apart = 1e3 * place.distance(Vec3::new(x, y, z));
            assert!(apart < 0.05, "Gaussian {i}: {apart} mm");
        }
    }
}
