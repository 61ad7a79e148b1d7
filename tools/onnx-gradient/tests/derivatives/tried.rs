//! A network's gradient as ONNX Runtime computes it, and by finite differences.

use crate::reference::{Array, run, whole};
use npu_runtime::{Provider, Runtime, Session, TensorSpec};
use onnx_gradient::append_gradient;
use test_support::network::Net;

/// Half of a finite difference's step.
const ASIDE: f64 = 1e-6;

/// A picture by chance, of values -1..=1.
pub(crate) fn picture(shape: &[usize], rng: &mut fastrand::Rng) -> Vec<f32> {
    let count: usize = shape.iter().product();
    (0..count).map(|_| 2.0 * rng.f32() - 1.0).collect()
}

fn array(shape: &[usize], values: &[f32]) -> Array {
    Array::new(
        shape,
        values.iter().map(|value| f64::from(*value)).collect(),
    )
}

/// What ONNX Runtime gives of two pictures: the output, and its derivatives by `a`.
pub(crate) fn computed(
    runtime: &Runtime,
    onnx: &[u8],
    shape: &[usize],
    pictures: [&[f32]; 2],
) -> (f32, Vec<f32>) {
    let derived = append_gradient(onnx, "a").expect("derived");
    assert_eq!(derived.shape, shape, "the picture's");
    assert!(derived.onnx.starts_with(onnx), "the network stays as it is");
    let model = <onnx_schema::Model as prost::Message>::decode(onnx).expect("a model");
    let output = &model.graph.expect("a graph").output[0];
    let dims = |info: &onnx_schema::ValueInfo| -> Vec<usize> {
        let tensor = info
            .r#type
            .as_ref()
            .and_then(|kind| kind.tensor_type.as_ref());
        let shape = tensor
            .and_then(|tensor| tensor.shape.as_ref())
            .expect("a shape");
        shape
            .dim
            .iter()
            .map(|side| whole(side.dim_value.expect("a side")))
            .collect()
    };
    let outputs = [
        TensorSpec::new(output.name.as_deref().expect("a name"), &dims(output)),
        TensorSpec::new(&derived.gradient, shape),
    ];
    let inputs = ["a", "b"].map(|name| TensorSpec::new(name, shape));
    let provider = Provider::Cpu { threads: 1 };
    let mut session = Session::new(runtime, &derived.onnx, provider, &inputs, &outputs)
        .unwrap_or_else(|why| panic!("{why:?}"));
    for (at, picture) in pictures.iter().enumerate() {
        session.input_mut(at).copy_from_slice(picture);
    }
    let mut results = session.outputs().expect("memory");
    session
        .run(&mut results)
        .unwrap_or_else(|why| panic!("{why:?}"));
    (results.get(0)[0], results.get(1).to_vec())
}

/// Checks the gradient of `net` by its picture `a` against finite differences at `count` pixels, of all the worst as a share of the largest derivative: which is returned.
pub(crate) fn check(runtime: &Runtime, net: &Net, shape: &[usize], count: usize, most: f64) -> f64 {
    let mut rng = fastrand::Rng::with_seed(17);
    let pictures = [(); 2].map(|()| picture(shape, &mut rng));
    let [a, b] = &pictures;
    let (output, gradient) = computed(runtime, &net.file(), shape, [a, b]);
    let (mut moved, other) = (array(shape, a), array(shape, b));
    let expected = run(&net.graph, &[("a", &moved), ("b", &other)]);
    let scale = expected.abs().max(1e-3);
    assert!(
        (f64::from(output) - expected).abs() < 1e-4 * scale,
        "the output is {output}, not {expected}"
    );
    let largest = gradient
        .iter()
        .fold(0.0f32, |most, value| most.max(value.abs()));
    assert!(largest > 0.0, "something is derived");
    let step = (a.len() / count).max(1);
    let mut worst: f64 = 0.0;
    for at in (0..a.len()).step_by(step) {
        let kept = moved.values[at];
        let mut aside = |by: f64| {
            moved.values[at] = kept + by;
            run(&net.graph, &[("a", &moved), ("b", &other)])
        };
        let slope = (aside(ASIDE) - aside(-ASIDE)) / (2.0 * ASIDE);
        moved.values[at] = kept;
        let error = (slope - f64::from(gradient[at])).abs() / f64::from(largest);
        assert!(
            error < most,
            "by pixel {at}: {}, not {slope}; the largest is {largest}",
            gradient[at]
        );
        worst = worst.max(error);
    }
    worst
}
