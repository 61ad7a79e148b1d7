//! A network's file as a loss.

use npu_runtime::Runtime;
use perceptual_loss::{Lpips, NetworkFile};
use splat_gradient::loss::PerceptualLoss;
use std::path::PathBuf;
use tempfile::TempDir;
use test_support::errors::whole_message;
use test_support::network::Net;
use test_support::{lpips, onnx};

const CHANNELS: [i64; 5] = [6, 8, 8, 6, 6];

fn written(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("lpips.onnx");
    std::fs::write(&path, bytes).expect("written");
    (folder, path)
}

fn refused(bytes: &[u8], runtime: &Runtime) -> String {
    let (_folder, path) = written(bytes);
    let error = Lpips::open(&path, runtime, 1).expect_err("refused");
    let said = whole_message(&error);
    println!("{said}");
    assert!(said.contains("lpips.onnx"), "the file is named: {said}");
    said
}

/// Bright and dark stripes, each shade by chance.
fn picture(numbers: usize, seed: u64) -> Vec<f32> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..numbers).map(|_| rng.f32()).collect()
}

#[test]
fn following_the_gradient_brings_the_pictures_together() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let (_folder, path) = written(&lpips::alexnet(17, 64, CHANNELS).file());
    let mut network = Lpips::open(&path, &runtime, 1).expect("opened");
    assert_eq!(network.size(), [64, 64], "pixels");
    assert_eq!(network.identity().len(), 64, "SHA-256");
    let numbers = 3 * 64 * 64;
    let (mut drawn, wanted) = (picture(numbers, 1), picture(numbers, 2));
    let mut by = vec![0.0; numbers];
    let mut distance =
        |drawn: &[f32], by: &mut [f32]| network.compare(drawn, &wanted, by).expect("compared");
    let first = distance(&drawn, &mut by);
    // The slope along the gradient is its square.
    let square: f64 = by.iter().map(|by| f64::from(*by).powi(2)).sum();
    let step = 1e-3 * first / square;
    #[expect(clippy::cast_possible_truncation, reason = "a length")]
    let moved = |by_step: f64| -> Vec<f32> {
        let pixels = drawn.iter().zip(&by);
        pixels
            .map(|(pixel, by)| pixel - by_step as f32 * by)
            .collect()
    };
    let (less, more) = (moved(step), moved(-step));
    let mut unused = vec![0.0; numbers];
    let slope = (distance(&more, &mut unused) - distance(&less, &mut unused)) / (2.0 * step);
    assert!(
        (slope / square - 1.0).abs() < 0.02,
        "{slope} along the gradient, not {square}"
    );
    for _ in 0..200 {
        let square: f64 = by.iter().map(|by| f64::from(*by).powi(2)).sum();
        #[expect(clippy::cast_possible_truncation, reason = "a length")]
        let step = (0.05 * first / square.max(1e-30)) as f32;
        for (pixel, by) in drawn.iter_mut().zip(&by) {
            *pixel -= step * by;
        }
        distance(&drawn, &mut by);
    }
    let last = distance(&drawn, &mut by);
    println!("{first} at first, {last} after 200 steps");
    assert!(last < 0.7 * first, "{first} at first, {last} at last");
}

#[test]
fn threads_do_not_change_a_bit() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    for (name, side, net) in [
        ("AlexNet", 128, lpips::alexnet(17, 128, lpips::ALEXNET)),
        ("SqueezeNet", 256, lpips::squeezenet(17, 256, 4)),
        ("VGG16", 256, lpips::vgg(17, 256, [8; 5])),
    ] {
        let (_folder, path) = written(&net.file());
        let numbers = 3 * side * side;
        let (drawn, wanted) = (picture(numbers, 1), picture(numbers, 2));
        let on = |threads: usize| {
            let mut network = Lpips::open(&path, &runtime, threads).expect("opened");
            let mut by = vec![0.0; numbers];
            let distance = network.compare(&drawn, &wanted, &mut by).expect("compared");
            let bits: Vec<u32> = by.iter().map(|by| by.to_bits()).collect();
            (distance.to_bits(), bits)
        };
        let alone = on(1);
        assert!(on(1) == alone, "{name}: again");
        for threads in [2, 3, 4] {
            assert!(on(threads) == alone, "{name}: {threads} threads");
        }
    }
}

#[test]
fn files_that_are_no_lpips_are_refused_by_name() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let missing = Lpips::open(&PathBuf::from("/nowhere/lpips.onnx"), &runtime, 1);
    let said = whole_message(&missing.expect_err("not there"));
    assert!(
        said.contains("/nowhere/lpips.onnx") && said.contains("read"),
        "{said}"
    );
    let said = refused(b"no network", &runtime);
    assert!(said.contains("no ONNX file"), "{said}");
    let said = refused(b"", &runtime);
    assert!(said.contains("no graph"), "{said}");

    let sum = |shape: &[i64], change: &dyn Fn(&mut Net)| {
        let mut net = Net::new(17, shape);
        let apart = net.node("Sub", &["a", "b"], &[]);
        let squares = net.node("Mul", &[&apart, &apart], &[]);
        let sum = net.reduce("ReduceSum", &squares, &[], true);
        net.output(&sum, &vec![1; shape.len()]);
        change(&mut net);
        net.file()
    };
    let said = refused(&sum(&[1, 4, 8, 8], &|_| {}), &runtime);
    assert!(
        said.contains("[1, 4, 8, 8]") && said.contains("height"),
        "{said}"
    );
    let said = refused(&sum(&[1, 3, 8], &|_| {}), &runtime);
    assert!(said.contains("[1, 3, 8]"), "{said}");
    let said = refused(&sum(&[1, 3, 5000, 8], &|_| {}), &runtime);
    assert!(said.contains("8 x 5000") && said.contains("4096"), "{said}");
    let said = refused(&sum(&[1, 3, -1, 8], &|_| {}), &runtime);
    assert!(said.contains("a has an open side"), "{said}");
    let said = refused(
        &sum(&[1, 3, 8, 8], &|net| {
            net.graph.input.pop();
        }),
        &runtime,
    );
    assert!(
        said.contains("2 inputs") && said.contains("it has 1"),
        "{said}"
    );
    let said = refused(
        &sum(&[1, 3, 8, 8], &|net| {
            let again = net.graph.output[0].clone();
            net.graph.output.push(again);
        }),
        &runtime,
    );
    assert!(said.contains("it has 2"), "{said}");
    let said = refused(
        &sum(&[1, 3, 8, 8], &|net| {
            let apart = net.node("Sigmoid", &["a"], &[]);
            let sum = net.reduce("ReduceSum", &apart, &[], true);
            net.output(&sum, &[1; 4]);
        }),
        &runtime,
    );
    assert!(
        said.contains("gradient") && said.contains("Sigmoid"),
        "{said}"
    );
    // A file that reads well, but that ONNX Runtime does not take.
    let said = refused(
        &sum(&[1, 3, 8, 8], &|net| {
            net.node("NoSuchOperator", &["b"], &[]);
        }),
        &runtime,
    );
    assert!(
        said.contains("ONNX Runtime") && said.contains("NoSuchOperator"),
        "{said}"
    );

    let (_folder, path) = written(&sum(&[1, 3, 8, 6], &|_| {}));
    let file = NetworkFile::read(&path, 2).expect("sound");
    assert_eq!(file.size, [6, 8], "width, then height");
    let one = NetworkFile::read(&path, 1).expect_err("it takes two");
    assert!(whole_message(&one).contains("1 inputs"), "{one:?}");
    let mut network = Lpips::open(&path, &runtime, 1).expect("sound");
    let few = network.compare(&[0.0; 9], &[0.0; 144], &mut [0.0; 144]);
    let said = few.expect_err("too few").to_string();
    assert!(said.contains("9 numbers, 144 expected"), "{said}");
    let wild = network.compare(&[f32::INFINITY; 144], &[0.0; 144], &mut [0.0; 144]);
    let said = whole_message(&wild.expect_err("not finite"));
    assert!(
        said.contains("not finite") && said.contains("lpips.onnx"),
        "{said}"
    );
}
