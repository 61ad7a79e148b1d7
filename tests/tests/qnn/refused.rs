//! A graph that the NPU cannot run whole is refused by the operator's name; a missing provider is named with the reason.

use super::QNN;
use npu_runtime::{Provider, ProviderKind, RuntimeError, Session, TensorSpec};
use test_support::onnx::{field, runtime, runtime_with_qnn};

#[test]
fn an_operator_that_the_npu_lacks_is_named_and_nothing_goes_to_the_cpu() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    let ports = (
        [TensorSpec::new("x", &[1, 64])],
        [TensorSpec::new("z", &[1, 64])],
    );
    let with = |operator: &str, provider| {
        let model = two_operators("Sigmoid", operator);
        Session::new(&runtime, &model, provider, &ports.0, &ports.1)
    };
    let session = with("Tanh", QNN).expect("both are on the NPU");
    assert!(
        session.landing().is_wholly_on(ProviderKind::Qnn),
        "{}",
        session.landing()
    );
    let session = with("Erf", Provider::Cpu { threads: 1 }).expect("the CPU has both");
    assert_eq!(
        session.landing().nodes["CPUExecutionProvider"],
        2,
        "both nodes"
    );
    let error = with("Erf", QNN).expect_err("the NPU has no Erf");
    let text = error.to_string();
    assert!(matches!(error, RuntimeError::Refused { .. }), "{text}");
    for word in ["QNN", "Erf", "second", "CPU"] {
        assert!(text.contains(word), "`{word}` is missing in: {text}");
    }
}

#[test]
fn every_provider_is_available_or_has_a_reason() {
    let Some(runtime) = runtime() else { return };
    let found = runtime.probe();
    let kinds: Vec<ProviderKind> = found.iter().map(|one| one.provider).collect();
    assert_eq!(kinds, ProviderKind::ALL, "in order of preference");
    let model = two_operators("Sigmoid", "Tanh");
    let ports = (
        [TensorSpec::new("x", &[1, 64])],
        [TensorSpec::new("z", &[1, 64])],
    );
    for one in &found {
        println!("{one}");
        let provider = match one.provider {
            ProviderKind::Qnn => QNN,
            ProviderKind::Nnapi => Provider::Nnapi,
            ProviderKind::Xnnpack => Provider::Xnnpack { threads: 1 },
            ProviderKind::Cpu => Provider::Cpu { threads: 1 },
        };
        let session = Session::new(&runtime, &model, provider, &ports.0, &ports.1);
        match (&one.lacking, session) {
            (None, session) => drop(session.expect("what the probe promised")),
            (Some(why), session) => {
                let error = session.expect_err("what the probe denied").to_string();
                assert!(!why.is_empty(), "{} gives no reason", one.provider);
                assert!(error.contains(why), "{error}");
                assert!(error.contains(&one.provider.to_string()), "{error}");
            }
        }
    }
    let cpu = found.last().expect("the CPU is the last");
    assert_eq!(cpu.lacking, None, "the CPU is always there");
    let json = serde_json::to_value(&found).expect("it is exported");
    assert_eq!(json[3]["provider"], "cpu", "{json}");
}

/// An ONNX model z = second(first(x)) over [1, 64] floats, written by hand in protobuf's wire format.
fn two_operators(first: &str, second: &str) -> Vec<u8> {
    let node = |input: &str, output: &str, name: &str, operator: &str| {
        [
            field(1, input.as_bytes()),
            field(2, output.as_bytes()),
            field(3, name.as_bytes()),
            field(4, operator.as_bytes()),
        ]
        .concat()
    };
    let port = |name: &str| {
        let dim = |size: u8| field(1, &[1 << 3, size]);
        let shape = [dim(1), dim(64)].concat();
        // elem_type FLOAT, then the shape.
        let tensor = [vec![1 << 3, 1], field(2, &shape)].concat();
        [field(1, name.as_bytes()), field(2, &field(1, &tensor))].concat()
    };
    let graph = [
        field(1, &node("x", "y", "first", first)),
        field(1, &node("y", "z", "second", second)),
        field(2, b"two"),
        field(11, &port("x")),
        field(12, &port("z")),
    ]
    .concat();
    // IR version 8, operator set 17.
    let head = [vec![1 << 3, 8], field(8, &[2 << 3, 17])].concat();
    [head, field(7, &graph)].concat()
}
