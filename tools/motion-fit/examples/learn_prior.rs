//! Writes `src/body/prior_table.rs` from recordings beside the repository (`../shared/data`: two of CMU's and MakeHuman's) and the built-in stance:
//! `cargo run -p motion-fit --example learn_prior > tools/motion-fit/src/body/prior_table.rs`.
//!
//! Each counts alike, however long it is, and once more as in a mirror. The table holds the mean rotation vectors and the principal
//! components of their covariance, each scaled by its standard deviation; nothing of the recordings themselves.

#[path = "../tests/common/mod.rs"]
mod common;

use nalgebra::{DMatrix, DVector};
use spmm3::{Joint, MotionParams};

const BODY_JOINTS: usize = 22;
const VALUES: usize = 3 * BODY_JOINTS;
/// Components kept.
const COMPONENTS: usize = 10;
/// Frames a second that are looked at.
const RATE: f64 = 20.0;

/// The rotation vectors of the body; the pelvis' are left zero: where a person faces says nothing of the pose.
fn vector(motion: &MotionParams, mirrored: bool) -> DVector<f64> {
    let mut out = DVector::zeros(VALUES);
    for joint in Joint::ALL.into_iter().take(BODY_JOINTS).skip(1) {
        let name = joint.name();
        let twin = name
            .strip_prefix("left_")
            .map(|n| format!("right_{n}"))
            .or_else(|| name.strip_prefix("right_").map(|n| format!("left_{n}")));
        let source = match (mirrored, twin) {
            (true, Some(twin)) => Joint::ALL
                .into_iter()
                .find(|j| j.name() == twin)
                .unwrap_or(joint),
            _ => joint,
        };
        let v = motion.axis_angle(source);
        let side = if mirrored { -1.0 } else { 1.0 };
        for (axis, value) in [v.x, v.y * side, v.z * side].into_iter().enumerate() {
            out[3 * joint.index() + axis] = f64::from(value);
        }
    }
    out
}

fn main() {
    let names = [
        "mocap/cmu_02_01_walk.bvh",
        "mocap/cmu_02_05_punch.bvh",
        "human/walk1.bvh",
    ];
    let clips: Vec<_> = names.into_iter().filter_map(common::recording).collect();
    let mut all: Vec<Vec<MotionParams>> = clips
        .iter()
        .map(|clip| common::frames(clip, RATE))
        .collect();
    // The recordings walk and fight; a person in a call mostly stands.
    all.push(vec![spmm3::at_ease(&common::skeleton())]);
    let mut samples: Vec<(f64, DVector<f64>)> = Vec::new();
    for frames in &all {
        let weight = 0.5 / frames.len() as f64 / all.len() as f64;
        for frame in frames {
            samples.push((weight, vector(frame, false)));
            samples.push((weight, vector(frame, true)));
        }
    }
    let mut mean = DVector::<f64>::zeros(VALUES);
    for (weight, sample) in &samples {
        mean += sample * *weight;
    }
    let mut covariance = DMatrix::<f64>::zeros(VALUES, VALUES);
    for (weight, sample) in &samples {
        let d = sample - &mean;
        covariance += &d * d.transpose() * *weight;
    }
    let eigen = covariance.symmetric_eigen();
    let mut order: Vec<usize> = (0..VALUES).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let whole: f64 = eigen.eigenvalues.iter().sum();
    let kept: f64 = order
        .iter()
        .take(COMPONENTS)
        .map(|i| eigen.eigenvalues[*i])
        .sum();

    println!(
        "//! Made by `cargo run -p motion-fit --example learn_prior`, which says from what. The components hold {:.1} % of the variance.",
        100.0 * kept / whole
    );
    println!("\n#![cfg_attr(rustfmt, rustfmt_skip)]\n");
    println!("/// Components of [`COMPONENTS`].\npub(super) const COUNT: usize = {COMPONENTS};\n");
    let print = |values: &mut dyn Iterator<Item = f64>| {
        let text: Vec<String> = values
            .map(|v| format!("{:.3}", if v.abs() < 5e-4 { 0.0 } else { v }))
            .collect();
        text.join(", ")
    };
    println!(
        "/// Mean rotation vectors by joint, radians.\npub(super) const MEAN: [f64; {VALUES}] = ["
    );
    println!("    {},\n];\n", print(&mut mean.iter().copied()));
    println!(
        "/// Principal components times their standard deviations, radians.\npub(super) const COMPONENTS: [[f64; {VALUES}]; COUNT] = ["
    );
    for i in order.into_iter().take(COMPONENTS) {
        let deviation = eigen.eigenvalues[i].max(0.0).sqrt();
        let column = eigen.eigenvectors.column(i);
        println!(
            "    [{}],",
            print(&mut column.iter().map(|v| v * deviation))
        );
    }
    println!("];");
}
