//! Time of the body's fit and of smoothing, median and 95th percentile:
//! `cargo run --release -p motion-fit --example body_speed`. The dev profile optimises, too, but checks overflow.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/synthetic.rs"]
mod synthetic;

use motion_fit::{
    body::{BodyFit, FitConfig},
    smoother::{Confidence, SmoothConfig, Smoother},
};
use std::time::Instant;
use synthetic::{Errors, Eye, Network, RATE, motion, performance};

fn main() {
    let Some(truth) = performance("mocap/cmu_02_05_punch.bvh", 0.0) else {
        return;
    };
    let skeleton = common::skeleton();
    let mut network = Network::new(Eye::new(1.3, 5.0, 0.1), Errors::USUAL, 11);
    let mut fit = BodyFit::new(&skeleton, FitConfig::new(network.eye.camera));
    let mut smoother = Smoother::new(SmoothConfig::default());
    let mut times = [Vec::new(), Vec::new()];
    for (i, frame) in truth.iter().enumerate() {
        let seen = network.look(&skeleton, frame, 1.0 / RATE);
        let seconds = i as f64 / RATE;
        let start = Instant::now();
        let pose = fit.fit(seconds, Some(&seen));
        times[0].push(start.elapsed().as_secs_f64() * 1e6);
        let mut motion = motion(&pose);
        let start = Instant::now();
        smoother.smooth(seconds, &mut motion, &Confidence::default());
        times[1].push(start.elapsed().as_secs_f64() * 1e6);
    }
    for (name, times) in ["fit", "smoothing"].into_iter().zip(&mut times) {
        // The first pictures are fitted twice, while left and right are in doubt.
        println!("{name}: the first picture {:.0} us", times[0]);
        times.drain(..15);
        times.sort_by(f64::total_cmp);
        println!(
            "{name}: median {:.0} us, 95th percentile {:.0} us, {} pictures",
            times[times.len() / 2],
            times[times.len() * 95 / 100],
            times.len()
        );
    }
}
