//! Files that are no network that can be derived.

use onnx_gradient::append_gradient;
use onnx_schema::{Attribute, Dimension, Model, Tensor, ValueInfo, data_location, data_type};
use prost::Message;
use test_support::lpips;
use test_support::network::Net;

const PICTURE: [i64; 4] = [1, 3, 8, 8];

/// A network that sums what `build` makes of the picture `a`.
fn net(build: impl FnOnce(&mut Net) -> String) -> Net {
    let mut net = Net::new(17, &PICTURE);
    let value = build(&mut net);
    let sum = net.reduce("ReduceSum", &value, &[], true);
    net.output(&sum, &[1, 1, 1, 1]);
    net
}

/// A convolution with a setting.
fn conv(setting: Attribute) -> Net {
    net(|net| {
        let weights = net.floats(&[3, 3, 2, 2], &[0.5; 36]);
        net.node("Conv", &["a", &weights], &[setting])
    })
}

/// A sound network, changed.
fn changed(change: impl FnOnce(&mut Model)) -> Vec<u8> {
    let mut model = net(|net| net.node("Relu", &["a"], &[])).model();
    change(&mut model);
    model.encode_to_vec()
}

fn graph(model: &mut Model) -> &mut onnx_schema::Graph {
    model.graph.as_mut().expect("a graph")
}

/// Each broken file, and words of the error that it should give.
fn broken() -> Vec<(Vec<u8>, &'static [&'static str])> {
    let pool = |setting: Attribute| {
        net(|net| {
            let kernel = Attribute::ints("kernel_shape", &[2, 2]);
            net.node("MaxPool", &["a"], &[kernel, setting])
        })
        .file()
    };
    vec![
        (vec![0xff; 40], &["no ONNX file"]),
        (Vec::new(), &["opset 0", "11 to 22"]),
        (changed(|model| model.graph = None), &["no graph"]),
        (
            changed(|model| model.opset_import[0].version = Some(9)),
            &["opset 9"],
        ),
        (
            changed(|model| {
                let port = graph(model).input[0].r#type.as_mut().expect("a type");
                let tensor = port.tensor_type.as_mut().expect("a tensor");
                let shape = tensor.shape.as_mut().expect("a shape");
                shape.dim[2] = Dimension { dim_value: None };
            }),
            &["a has an open side", "static shapes"],
        ),
        (
            changed(|model| {
                let port = graph(model).input[0].r#type.as_mut().expect("a type");
                let tensor = port.tensor_type.as_mut().expect("a tensor");
                tensor.elem_type = Some(data_type::FLOAT16);
            }),
            &["a is no tensor of 32-bit floats"],
        ),
        (
            changed(|model| graph(model).output.push(ValueInfo::float("v1", &PICTURE))),
            &["2 outputs"],
        ),
        (
            changed(|model| graph(model).output = vec![ValueInfo::float("v1", &PICTURE)]),
            &["v1", "[1, 3, 8, 8]", "one number"],
        ),
        (
            changed(|model| graph(model).output = vec![ValueInfo::float("v9", &[1])]),
            &["nothing gives its output v9"],
        ),
        (
            changed(|model| graph(model).output[0] = ValueInfo::float("v2", &[1])),
            &["v2", "declared as [1]", "[1, 1, 1, 1]"],
        ),
        (
            changed(|model| graph(model).node.swap(0, 1)),
            &["v1, which ReduceSum takes, is not there"],
        ),
        (
            changed(|model| {
                let again = graph(model).node[0].clone();
                graph(model).node.push(again);
            }),
            &["name \"v1\""],
        ),
        (
            changed(|model| {
                graph(model).initializer.push(Tensor {
                    name: Some("weights".into()),
                    data_location: Some(data_location::EXTERNAL),
                    ..Tensor::floats(&[1], &[1.0])
                });
            }),
            &["weights", "another file", "external_data=False"],
        ),
        (
            changed(|model| {
                graph(model).initializer.push(Tensor {
                    name: Some("weights".into()),
                    dims: vec![i64::MAX, i64::MAX],
                    ..Tensor::default()
                });
            }),
            &["weights has the shape"],
        ),
        (
            changed(|model| {
                graph(model).node[0].attribute.push(Attribute {
                    r#type: Some(5),
                    ..Attribute::int("then_branch", 0)
                });
            }),
            &["control flow (Relu)"],
        ),
        (
            changed(|model| graph(model).node[0].domain = Some("com.example".into())),
            &["operator Relu", "none of ONNX's own"],
        ),
        (
            changed(|model| {
                graph(model).node[0].op_type = Some("Sigmoid".into());
                graph(model).node[0].name = Some("/net/gate".into());
            }),
            &["operator Sigmoid", "/net/gate", "MaxPool, Mul"],
        ),
        (
            changed(|model| {
                let more = graph(model).node[0].clone();
                graph(model).node.extend(vec![more; 5000]);
            }),
            &["more nodes", "4096"],
        ),
        (
            net(|net| {
                let all = vec!["a"; 300];
                net.node("Concat", &all, &[Attribute::int("axis", 0)])
            })
            .file(),
            &["inputs or outputs of a node", "256"],
        ),
        (
            net(|net| {
                let twice = |net: &mut Net, value: String| {
                    net.node("Concat", &[&value, &value], &[Attribute::int("axis", 0)])
                };
                (0..62).fold("a".to_owned(), |value, _| twice(net, value))
            })
            .file(),
            &["more numbers in all values"],
        ),
        (
            net(|net| net.node("Relu", &["b"], &[])).file(),
            &["does not depend on its input a"],
        ),
        (
            net(|net| {
                let other = net.floats(&[5], &[1.0; 5]);
                net.node("Add", &["a", &other], &[])
            })
            .file(),
            &["operator Add", "do not fit", "[1, 3, 8, 8] and [5]"],
        ),
        (
            net(|net| {
                let three = net.floats(&[], &[3.0]);
                net.node("Pow", &["a", &three], &[])
            })
            .file(),
            &["operator Pow", "exponent is 3"],
        ),
        (
            net(|net| net.node("Pow", &["a", "b"], &[])).file(),
            &["operator Pow", "b is no small constant"],
        ),
        (
            net(|net| {
                let on = Attribute::tensor(
                    "value",
                    Tensor {
                        data_type: Some(data_type::BOOL),
                        raw_data: Some(vec![1]),
                        ..Tensor::default()
                    },
                );
                let on = net.node("Constant", &[], &[on]);
                let rate = net.floats(&[], &[0.5]);
                net.node("Dropout", &["a", &rate, &on], &[])
            })
            .file(),
            &["operator Dropout", "eval()"],
        ),
        (
            net(|net| {
                let shape = net.ints(&[7, -1]);
                net.node("Reshape", &["a", &shape], &[])
            })
            .file(),
            &["operator Reshape", "arranged as [7, 27]"],
        ),
        (
            net(|net| net.squeeze("Unsqueeze", "a", &[9])).file(),
            &["operator Unsqueeze", "axes are [9]"],
        ),
        (
            conv(Attribute::int("group", 3)).file(),
            &["operator Conv", "group"],
        ),
        (
            conv(Attribute::ints("dilations", &[2, 2])).file(),
            &["operator Conv", "dilations are [2, 2]"],
        ),
        (
            conv(Attribute::string("auto_pad", "SAME_UPPER")).file(),
            &["operator Conv", "auto_pad"],
        ),
        (
            conv(Attribute::ints("strides", &[0, 1])).file(),
            &["operator Conv", "out of range"],
        ),
        (
            conv(Attribute::ints("pads", &[-1, 0, 0, 0])).file(),
            &["operator Conv", "pads"],
        ),
        (
            net(|net| net.node("Conv", &["b", "a"], &[])).file(),
            &["operator Conv", "input 1 depends on the picture"],
        ),
        (
            pool(Attribute::ints("dilations", &[2, 1])),
            &["operator MaxPool", "dilations"],
        ),
        (
            pool(Attribute::int("storage_order", 1)),
            &["operator MaxPool", "storage_order"],
        ),
    ]
}

#[test]
fn broken_networks_are_refused_for_a_stated_reason() {
    for (file, words) in broken() {
        let said = match append_gradient(&file, "a") {
            Ok(_) => panic!("not refused: {words:?}"),
            Err(why) => why.to_string(),
        };
        println!("{said}");
        for word in words {
            assert!(said.contains(word), "{said}: no word of {word:?}");
        }
    }
    let sound = net(|net| net.node("Relu", &["a"], &[])).file();
    assert!(
        append_gradient(&sound, "a").is_ok(),
        "the one that was changed"
    );
    let said = append_gradient(&sound, "c").expect_err("no such input");
    assert!(said.to_string().contains("input c"), "{said}");
}

#[test]
fn damaged_files_give_an_error_or_a_gradient_and_no_panic() {
    let file = lpips::alexnet(17, 64, [2, 3, 2, 2, 2]).file();
    let mut rng = fastrand::Rng::with_seed(8);
    let mut refused = 0;
    for _ in 0..3000 {
        let mut damaged = file.clone();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(..damaged.len());
            damaged[at] = rng.u8(..);
        }
        if rng.bool() {
            damaged.truncate(rng.usize(..damaged.len()));
        }
        refused += usize::from(append_gradient(&damaged, "a").is_err());
    }
    println!("{refused} of 3000 were refused");
    assert!(refused > 1000, "damage is seen: {refused}");
}
