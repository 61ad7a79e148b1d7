//! What LPIPS costs in a step of a training: `cargo run --release -p perceptual-loss --example perceptual_step_cost [THREADS]`. Networks have the shapes of the
//! `lpips` package's and weights of chance; pictures are 256 x 256. Medians in milliseconds.

use perceptual_loss::Lpips;
use splat_gradient::loss::PerceptualLoss;
use std::time::Instant;
use test_support::lpips::{ALEXNET, alexnet, squeezenet, vgg};

const SIDE: i64 = 256;
const RUNS: usize = 21;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads: usize = match std::env::args().nth(1) {
        Some(threads) => threads.parse()?,
        None => std::thread::available_parallelism()?.get(),
    };
    let runtime = npu_runtime::Runtime::open(None)?;
    let folder = tempfile::tempdir()?;
    println!("{threads} threads, pictures of {SIDE} x {SIDE}: distance and gradient");
    for (name, net) in [
        ("AlexNet", alexnet(17, SIDE, ALEXNET)),
        ("SqueezeNet", squeezenet(17, SIDE, 1)),
        ("VGG16", vgg(17, SIDE, [64, 128, 256, 512, 512])),
    ] {
        let path = folder.path().join("network.onnx");
        std::fs::write(&path, net.file())?;
        let mut network = Lpips::open(&path, &runtime, threads)?;
        let numbers = 3 * network.size()[0] * network.size()[1];
        let mut rng = fastrand::Rng::with_seed(1);
        let mut picture = || -> Vec<f32> { (0..numbers).map(|_| rng.f32()).collect() };
        let (drawn, wanted, mut by) = (picture(), picture(), vec![0.0; numbers]);
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let start = Instant::now();
            network.compare(&drawn, &wanted, &mut by)?;
            times.push(1e3 * start.elapsed().as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        println!("{name:>10}: {:7.1} ms", times[RUNS / 2]);
    }
    Ok(())
}
