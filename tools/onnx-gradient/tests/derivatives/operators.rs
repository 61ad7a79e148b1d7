//! Every operator alone, at every opset.

use crate::reference::whole;
use crate::tried::check;
use onnx_schema::{Attribute, Tensor};
use test_support::network::Net;
use test_support::onnx;

const PICTURE: [i64; 4] = [1, 3, 9, 8];

type Build = fn(&mut Net, &mut fastrand::Rng) -> String;

fn pool(sides: [i64; 2], strides: [i64; 2], pads: [i64; 4], ceil: i64) -> Vec<Attribute> {
    vec![
        Attribute::ints("kernel_shape", &sides),
        Attribute::ints("strides", &strides),
        Attribute::ints("pads", &pads),
        Attribute::int("ceil_mode", ceil),
    ]
}

fn conv(
    net: &mut Net,
    rng: &mut fastrand::Rng,
    sides: [i64; 2],
    strides: [i64; 2],
    pads: [i64; 4],
) -> String {
    let weights = net.weights(&[4, 3, sides[0], sides[1]], 0.5, rng);
    let bias = net.weights(&[4], 0.5, rng);
    let settings = [
        Attribute::ints("kernel_shape", &sides),
        Attribute::ints("strides", &strides),
        Attribute::ints("pads", &pads),
    ];
    net.node("Conv", &["a", &weights, &bias], &settings)
}

/// What each does with the picture `a`, and with `b`, which is not derived by.
const CASES: [(&str, Build); 38] = [
    ("Conv, 3 x 3", |net, rng| {
        conv(net, rng, [3, 3], [1, 1], [1, 1, 1, 1])
    }),
    ("Conv, 2 x 3, pads of four lengths", |net, rng| {
        conv(net, rng, [2, 3], [1, 1], [1, 0, 0, 2])
    }),
    ("Conv, 1 x 1", |net, rng| {
        conv(net, rng, [1, 1], [1, 1], [0; 4])
    }),
    ("Conv, wider pads than windows", |net, rng| {
        conv(net, rng, [2, 2], [1, 1], [3, 3, 3, 3])
    }),
    ("Conv, 5 x 5 / 4, pixels left over", |net, rng| {
        conv(net, rng, [5, 5], [4, 4], [2, 2, 2, 2])
    }),
    ("Conv, strides of two lengths", |net, rng| {
        conv(net, rng, [3, 2], [2, 3], [1, 0, 1, 0])
    }),
    ("Conv, valid, no settings", |net, rng| {
        let weights = net.weights(&[4, 3, 3, 3], 0.5, rng);
        net.node(
            "Conv",
            &["a", &weights],
            &[Attribute::string("auto_pad", "VALID")],
        )
    }),
    ("MaxPool, 2 x 2 / 2", |net, _| {
        net.node("MaxPool", &["a"], &pool([2, 2], [2, 2], [0; 4], 0))
    }),
    ("MaxPool, 3 x 3 / 2", |net, _| {
        net.node("MaxPool", &["a"], &pool([3, 3], [2, 2], [0; 4], 0))
    }),
    ("MaxPool, 3 x 3 / 2, ceil", |net, _| {
        net.node("MaxPool", &["a"], &pool([3, 3], [2, 2], [0; 4], 1))
    }),
    ("MaxPool, 3 x 3 / 1, padded", |net, _| {
        net.node("MaxPool", &["a"], &pool([3, 3], [1, 1], [1; 4], 0))
    }),
    ("MaxPool, 2 x 3 / 3, 1", |net, _| {
        net.node("MaxPool", &["a"], &pool([2, 3], [3, 1], [0, 1, 1, 0], 0))
    }),
    ("Relu", |net, _| net.node("Relu", &["a"], &[])),
    ("Add", |net, _| net.node("Add", &["a", "b"], &[])),
    ("Add, to itself", |net, _| net.node("Add", &["a", "a"], &[])),
    ("Add, a constant of fewer dimensions", |net, rng| {
        let other = net.weights(&[3, 1, 1], 1.0, rng);
        net.node("Add", &[&other, "a"], &[])
    }),
    ("Sub", |net, _| net.node("Sub", &["a", "b"], &[])),
    ("Sub, from another", |net, _| {
        net.node("Sub", &["b", "a"], &[])
    }),
    ("Sub, its mean", |net, _| {
        let mean = net.reduce("ReduceMean", "a", &[2, 3], true);
        net.node("Sub", &["b", &mean], &[])
    }),
    ("Mul", |net, _| net.node("Mul", &["b", "a"], &[])),
    ("Mul, by itself", |net, _| net.node("Mul", &["a", "a"], &[])),
    ("Mul, by its sum without sides of 1", |net, _| {
        let sum = net.reduce("ReduceSum", "a", &[0, 1, 2], false);
        net.node("Mul", &["b", &sum], &[])
    }),
    ("Div", |net, rng| {
        let by = net.weights(&[1, 3, 1, 1], 1.0, rng);
        net.node("Div", &["a", &by], &[])
    }),
    ("Div, by a norm", |net, _| {
        let squares = net.node("Mul", &["a", "a"], &[]);
        let sum = net.reduce("ReduceSum", &squares, &[1], true);
        let norm = net.node("Sqrt", &[&sum], &[]);
        let little = net.floats(&[], &[1e-3]);
        let norm = net.node("Add", &[&norm, &little], &[]);
        net.node("Div", &["a", &norm], &[])
    }),
    ("Pow 2", |net, _| {
        let two = net.floats(&[], &[2.0]);
        net.node("Pow", &["a", &two], &[])
    }),
    ("Pow 0.5, of a node's constant", |net, _| {
        let squares = net.node("Mul", &["a", "a"], &[]);
        let one = net.floats(&[1], &[1.0]);
        let more = net.node("Add", &[&squares, &one], &[]);
        let half = Attribute::tensor("value", Tensor::floats(&[], &[0.5]));
        let half = net.node("Constant", &[], &[half]);
        net.node("Pow", &[&more, &half], &[])
    }),
    ("ReduceSum, over channels", |net, _| {
        net.reduce("ReduceSum", "a", &[1], true)
    }),
    ("ReduceSum, over all", |net, _| {
        net.reduce("ReduceSum", "a", &[], true)
    }),
    ("ReduceMean, over pixels", |net, _| {
        net.reduce("ReduceMean", "a", &[-1, 2], true)
    }),
    ("ReduceMean, over all, a number", |net, _| {
        net.reduce("ReduceMean", "a", &[], false)
    }),
    ("Identity, twice", |net, _| {
        let same = net.node("Identity", &["a"], &[]);
        net.node("Identity", &[&same], &[])
    }),
    ("Dropout", |net, _| net.node("Dropout", &["a"], &[])),
    ("Flatten", |net, _| {
        net.node("Flatten", &["a"], &[Attribute::int("axis", 2)])
    }),
    ("Flatten, to one column", |net, _| {
        net.node("Flatten", &["a"], &[Attribute::int("axis", 4)])
    }),
    ("Reshape", |net, _| {
        let shape = net.ints(&[0, -1, 4]);
        net.node("Reshape", &["a", &shape], &[])
    }),
    ("Squeeze", |net, _| net.squeeze("Squeeze", "a", &[0])),
    ("Unsqueeze", |net, _| net.squeeze("Unsqueeze", "a", &[1, 5])),
    ("Concat", |net, _| {
        let once = net.node("Concat", &["b", "a", "a"], &[Attribute::int("axis", 1)]);
        net.node("Concat", &[&once, &once], &[Attribute::int("axis", -1)])
    }),
];

#[test]
fn every_operators_derivative_is_its_finite_differences() {
    let Some(runtime) = onnx::runtime() else {
        return;
    };
    let shape = PICTURE.map(whole);
    let mut worst: f64 = 0.0;
    for opset in [11, 12, 13, 16, 17, 18, 22] {
        for (name, build) in CASES {
            println!("{name}, opset {opset}");
            let mut rng = fastrand::Rng::with_seed(5);
            let mut net = Net::new(opset, &PICTURE);
            let result = build(&mut net, &mut rng);
            // Not linear in what the operator gives, so that each number has a derivative of its own.
            let squares = net.node("Mul", &[&result, &result], &[]);
            let cubes = net.node("Mul", &[&squares, &result], &[]);
            let sum = net.node("Add", &[&cubes, &result], &[]);
            let sum = net.reduce("ReduceSum", &sum, &[], false);
            net.output(&sum, &[]);
            worst = worst.max(check(&runtime, &net, &shape, 216, 2e-5));
        }
    }
    println!("the worst error is {worst:.1e} of the largest derivative");
}
