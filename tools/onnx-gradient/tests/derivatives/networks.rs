//! Whole networks of the kind that this crate is for.

use crate::tried::{check, computed, picture};
use test_support::network::Net;
use test_support::{lpips, onnx};

/// Of small networks, some derivatives are 100 times smaller than the largest.
const MOST: f64 = 1e-4;

#[test]
fn lpips_by_a_picture_is_its_finite_differences() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    for opset in [11, 17, 18] {
        let few = [6, 8, 8, 6, 6];
        let nets = [
            ("AlexNet", 64, lpips::alexnet(opset, 64, few)),
            ("VGG16", 32, lpips::vgg(opset, 32, few)),
            ("SqueezeNet", 63, lpips::squeezenet(opset, 63, 16)),
        ];
        for (name, side, net) in nets {
            let worst = check(&runtime, &net, &[1, 3, side, side], 60, MOST);
            println!(
                "{name}, opset {opset}: the worst error is {worst:.1e} of the largest derivative"
            );
        }
    }
}

#[test]
fn equal_pictures_pull_nowhere() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let shape = [1, 3, 64, 64];
    let net = lpips::alexnet(17, 64, [6, 8, 8, 6, 6]);
    let one = picture(&shape, &mut fastrand::Rng::with_seed(2));
    let (distance, gradient) = computed(&runtime, &net.file(), &shape, [&one, &one]);
    assert!(distance.abs() < 1e-12, "{distance}");
    assert!(gradient.iter().all(|by| *by == 0.0), "nothing to gain");
}

#[test]
fn features_that_are_all_0_pull_nowhere_although_their_norm_has_no_derivative() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let shape = [1, 3, 8, 8];
    let mut rng = fastrand::Rng::with_seed(2);
    let mut net = Net::new(17, &[1, 3, 8, 8]);
    let features = ["a", "b"].map(|picture| {
        let weights = net.weights(&[12, 3, 3, 3], 0.3, &mut fastrand::Rng::with_seed(4));
        // The rectifiers let nothing through but where the picture is bright.
        let bias = net.floats(&[12], &[-2.0; 12]);
        let sums = net.node("Conv", &[picture, &weights, &bias], &[]);
        let features = net.node("Relu", &[&sums], &[]);
        let squares = net.node("Mul", &[&features, &features], &[]);
        let sum = net.reduce("ReduceSum", &squares, &[1], true);
        let norm = net.node("Sqrt", &[&sum], &[]);
        let little = net.floats(&[], &[1e-10]);
        let norm = net.node("Add", &[&norm, &little], &[]);
        net.node("Div", &[&features, &norm], &[])
    });
    let apart = net.node("Sub", &[&features[0], &features[1]], &[]);
    let squares = net.node("Mul", &[&apart, &apart], &[]);
    let sum = net.reduce("ReduceSum", &squares, &[], true);
    net.output(&sum, &[1, 1, 1, 1]);
    let mut a = vec![0.0; 192];
    let b = picture(&shape, &mut rng);
    let dark = computed(&runtime, &net.file(), &shape, [&a, &b]);
    assert!(dark.1.iter().all(|by| *by == 0.0), "all is 0: {:?}", dark.1);
    // Brightened in a corner, the others stay 0.
    for (at, value) in a.iter_mut().enumerate() {
        if at % 8 < 4 && at / 8 % 8 < 4 {
            *value = 3.0 * (2.0 * rng.f32() - 1.0);
        }
    }
    let (_, gradient) = computed(&runtime, &net.file(), &shape, [&a, &b]);
    assert!(gradient.iter().all(|by| by.is_finite()), "{gradient:?}");
    assert!(gradient.iter().any(|by| *by != 0.0), "something is seen");
}

#[test]
fn names_that_the_network_uses_are_not_taken_and_branches_beside_the_way_may_be_anything() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let shape = [1, 3, 4, 4];
    let mut net = Net::new(17, &[1, 3, 4, 4]);
    // Operators without a derivative, which only `b` goes through.
    let wave = net.node("Sin", &["b"], &[]);
    let wave = net.node("LeakyRelu", &[&wave], &[]);
    let flat = net.ints(&[1, 3, 4, 4]);
    let known = net.node("Reshape", &[&wave, &flat], &[]);
    let product = net.node("Mul", &["a", "a"], &[]);
    for number in 1..9 {
        net.graph.node.push(onnx_schema::Node {
            input: vec![product.clone()],
            output: vec![format!("gradient.{number}")],
            op_type: Some("Identity".into()),
            ..onnx_schema::Node::default()
        });
    }
    let sum = net.reduce("ReduceSum", "gradient.3", &[], true);
    net.output(&sum, &[1, 1, 1, 1]);
    let a = picture(&shape, &mut fastrand::Rng::with_seed(2));
    let (_, gradient) = computed(&runtime, &net.file(), &shape, [&a, &a]);
    for (by, value) in gradient.iter().zip(&a) {
        assert!((by - 2.0 * value).abs() < 1e-6, "{by} of {value}");
    }
    // On the way, a value of an unknown shape is named.
    let product = net.node("Mul", &["gradient.3", &known], &[]);
    let sum = net.reduce("ReduceSum", &product, &[], true);
    net.output(&sum, &[1, 1, 1, 1]);
    let said = onnx_gradient::append_gradient(&net.file(), "a");
    let said = said.expect_err("unknown").to_string();
    assert!(
        said.contains("operator Mul") && said.contains(&known),
        "{said}"
    );
}
