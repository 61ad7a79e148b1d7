//! The error of half precision on the NPU, against the f64 reference.

use super::{QNN, session};
use npu_runtime::{ProviderKind, Runtime};
use spmm3::networks::GraphParts;
use spmm3::{ATTRIBUTES, SkinningTransforms};
use std::time::Instant;
use synthetic_person::reference;
use synthetic_person::{Puppet, PuppetSize, Random};
use test_support::onnx::runtime_with_qnn;

/// Largest mean and largest single distance of a vertex, metres, in poses where every joint is turned far. A number near
/// 1 m has steps of half a millimetre to a millimetre in half precision, and each coordinate is a sum of four such.
const VERTEX_MEAN: f64 = 1e-3;
const VERTEX_MOST: f64 = 5e-3;
/// Largest error of a residual in parts of its plane's reach.
const RESIDUAL_MOST: f64 = 5e-3;

#[test]
fn a_small_person_runs_wholly_on_the_npu_and_nearly_as_in_f64() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    compare(&runtime, &Puppet::small(), 4);
}

#[test]
fn a_person_of_the_demos_size_runs_wholly_on_the_npu_and_nearly_as_in_f64() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    // One frame: the emulator takes a minute for it.
    compare(&runtime, &Puppet::new(PuppetSize::FULL), 1);
}

fn compare(runtime: &Runtime, puppet: &Puppet, frames: u64) {
    let (vertices, gaussians) = (puppet.template.vertices().len(), puppet.gaussians.len());
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    let started = Instant::now();
    let mut session = session(runtime, puppet, (&model).into()).expect("QNN takes the whole graph");
    println!(
        "{vertices} vertices, {gaussians} Gaussians: compiled in {:.1} s; {}",
        started.elapsed().as_secs_f64(),
        session.landing()
    );
    assert_eq!(session.provider(), QNN, "the provider");
    assert!(
        session.landing().is_wholly_on(ProviderKind::Qnn),
        "{}",
        session.landing()
    );
    let mut outputs = session.outputs().expect("memory for them");
    let rest = puppet.skeleton.rest_positions();
    let (mut sum, mut most) = (0.0, 0.0f64);
    let mut error = [0.0f64; ATTRIBUTES];
    let mut reach = [0.0f64; ATTRIBUTES];
    for seed in 0..frames {
        let motion = Random::new(seed).motion(0.6);
        let mut transforms = SkinningTransforms::default();
        puppet
            .skeleton
            .skinning(&puppet.skeleton.pose(&motion), &mut transforms);
        session.input_mut(0).copy_from_slice(motion.values());
        session.input_mut(1).copy_from_slice(&transforms.0);
        let started = Instant::now();
        session.run(&mut outputs).expect("the graph runs");
        println!("emulated in {:.2} s", started.elapsed().as_secs_f64());

        let posed = reference::posed_mesh(&puppet.template, rest, &puppet.mesh, motion.values());
        for (v, want) in posed.iter().enumerate() {
            let got = [0, 1, 2].map(|axis| f64::from(outputs.get(0)[axis * vertices + v]));
            let far = reference::norm(reference::sub(*want, got));
            sum += far;
            most = most.max(far);
        }
        let residuals =
            reference::residuals(&puppet.attributes, &puppet.controllers, motion.values());
        for (i, want) in residuals.iter().enumerate() {
            for (plane, want) in want.iter().enumerate() {
                let got = f64::from(outputs.get(1)[plane * gaussians + i]);
                error[plane] = error[plane].max((got - want).abs());
                reach[plane] = reach[plane].max(want.abs());
            }
        }
    }
    let mean = sum / (vertices as f64 * frames as f64);
    let worst = (0..ATTRIBUTES)
        .map(|plane| error[plane] / reach[plane])
        .fold(0.0, f64::max);
    println!(
        "vertices: mean {:.3} mm, most {:.3} mm; residuals: most {worst:.1e} of their plane's reach",
        mean * 1e3,
        most * 1e3
    );
    assert!(mean <= VERTEX_MEAN, "vertices are {mean} m off on average");
    assert!(most <= VERTEX_MOST, "a vertex is {most} m off");
    assert!(worst <= RESIDUAL_MOST, "a residual is {worst} off");
    // In single precision it would agree far better: then the emulator did not get the chip.
    assert!(most > 5e-5, "this was not half precision: {most} m");
}
