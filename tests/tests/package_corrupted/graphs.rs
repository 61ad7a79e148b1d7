//! Deform graphs that do more than a deform graph may.

use crate::Court;
use crate::parts::{GRAPH, Parts};
use spmm3::Controllers;
use synthetic_person::Puppet;
use test_support::onnx::field;

/// Where a stored tensor's numbers begin: its name, the key of raw data, a length, then they.
fn raw_data(graph: &[u8], tensor: &str) -> usize {
    let named = [tensor.as_bytes(), &[9 << 3 | 2]].concat();
    let found = graph.windows(named.len()).position(|w| w == named);
    let mut at = found.expect("a stored tensor of this name") + named.len();
    while graph[at] & 0x80 != 0 {
        at += 1;
    }
    at + 1
}

pub(crate) fn wrong_graphs(court: &mut Court, parts: &Parts) {
    let mut change = |what: &str, reason: &str, edit: &dyn Fn(&mut Vec<u8>)| {
        let mut broken = parts.clone();
        edit(broken.member(GRAPH));
        court.refuse(what, &broken.rehash().pack(), reason);
    };
    let replace = |from: &'static str, to: &'static str| {
        move |graph: &mut Vec<u8>| {
            assert_eq!(from.len(), to.len(), "the lengths around it stay true");
            let mut at = 0;
            while at + from.len() <= graph.len() {
                if graph[at..].starts_with(from.as_bytes()) {
                    graph[at..at + from.len()].copy_from_slice(to.as_bytes());
                }
                at += 1;
            }
        }
    };
    for (from, to) in [("Gemm", "Loop"), ("Gather", "DQNcpu"), ("Mul", "If\0")] {
        change(&format!("{to} for {from}"), "operator", &replace(from, to));
    }
    for (from, to) in [
        ("motion", "Motion"),
        ("skinning", "Skinning"),
        ("posed_vertices", "posed_triangle"),
        ("residuals", "Residuals"),
    ] {
        change(
            &format!("{to} for {from}"),
            "counts need",
            &replace(from, to),
        );
    }
    for tensor in [
        "mesh.decoder.unit",
        "mesh.canonical",
        "skin.weights",
        "attr.mass2",
    ] {
        for value in [f32::NAN, f32::INFINITY] {
            change("a number that is NaN", "not finite", &|graph| {
                let at = raw_data(graph, tensor);
                graph[at..at + 4].copy_from_slice(&value.to_le_bytes());
            });
        }
    }
    for tensor in [
        "attr.bases.scales",
        "mesh.first.weights",
        "attr.second.weights",
    ] {
        change("a half that is NaN", "not finite", &|graph| {
            let at = raw_data(graph, tensor);
            graph[at..at + 2].copy_from_slice(&half::f16::NAN.to_le_bytes());
        });
    }
    change("an empty graph", "no graph", &Vec::clear);
    change("a text", GRAPH, &|graph| *graph = b"hello".to_vec());
    for keep in [3, 10, 1_000, 100_000] {
        change("half a graph", GRAPH, &|graph| graph.truncate(keep));
    }
    let stored = |tensor: Vec<u8>| field(7, &field(5, &tensor));
    let outside = field(
        13,
        &[field(1, b"location"), field(2, b"/etc/passwd")].concat(),
    );
    change(
        "numbers in another file",
        "raw data in this file",
        &|graph| {
            *graph = stored([field(8, b"w"), outside.clone()].concat());
        },
    );
    change("a tensor of 2^62 x 2^62", "bytes for shape", &|graph| {
        let size = [8, 128, 128, 128, 128, 128, 128, 128, 128, 64];
        let floats = [16, 1];
        *graph = stored([&size[..], &size, &floats, &field(8, b"w")].concat());
    });
    change("a domain of its own", "foreign", &|graph| {
        let node = [field(4, b"Add"), field(7, b"com.example")].concat();
        *graph = field(7, &field(1, &node));
    });
    change("a graph in an attribute", "attribute", &|graph| {
        let node = [field(4, b"Add"), field(5, &field(6, b""))].concat();
        *graph = field(7, &field(1, &node));
    });
    change("two graphs", "more than one", &|graph| {
        let second = graph.clone();
        graph.extend(second);
    });
    change("a million empty nodes", "operator", &|graph| {
        *graph = field(7, &field(1, b"").repeat(1_000_000));
    });
    change("a million nodes", "more nodes", &|graph| {
        *graph = field(7, &field(1, &field(4, b"Add")).repeat(1_000_000));
    });
    change("a varint without end", GRAPH, &|graph| {
        *graph = vec![0xff; 64];
    });
}

/// The model with other graph parts between its versions and its operator set, which stay.
fn with_body(model: &[u8], edit: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let producer = b"mon3tr";
    let found = model.windows(producer.len()).position(|w| w == producer);
    let key = found.expect("the producer's name") + producer.len();
    assert_eq!(model[key], 7 << 3 | 2, "the graph follows");
    let length = model[key + 1..].iter().position(|b| b & 0x80 == 0);
    let start = key + 2 + length.expect("a length");
    let tail = b"\x42\x04\x0a\x00\x10\x11";
    assert!(model.ends_with(tail), "operator set 17 ends the file");
    let mut body = model[start..model.len() - tail.len()].to_vec();
    edit(&mut body);
    [&model[..key], &field(7, &body), &tail[..]].concat()
}

fn node(operator: &str, inputs: &[&str], output: &str) -> Vec<u8> {
    let mut content: Vec<u8> = inputs.iter().flat_map(|i| field(1, i.as_bytes())).collect();
    content.extend(field(2, output.as_bytes()));
    content.extend(field(4, operator.as_bytes()));
    field(1, &content)
}

/// Known operators, finite numbers, true hashes, the right inputs and outputs: and still not the format's graph.
pub(crate) fn graphs_of_their_own(court: &mut Court, parts: &Parts) {
    let mut change = |what: &str, reason: &str, edit: &dyn Fn(&mut Vec<u8>)| {
        let mut broken = parts.clone();
        let graph = broken.member(GRAPH);
        *graph = with_body(graph, edit);
        court.refuse(what, &broken.rehash().pack(), reason);
    };
    // Two vectors of 128 KiB whose product takes 4 GiB, added to the residuals as one number.
    let length: i32 = 32_768;
    let vector = |name: &str, rows: i32, columns: i32| {
        let size = |n: i32| {
            let mut out = vec![8];
            let mut n = u32::try_from(n).expect("a size");
            while n > 0x7f {
                out.push(n.to_le_bytes()[0] | 0x80);
                n >>= 7;
            }
            out.push(n.to_le_bytes()[0]);
            out
        };
        let raw = vec![0u8; 4 * 32_768];
        let parts = [
            size(rows),
            size(columns),
            vec![16, 1],
            field(8, name.as_bytes()),
            field(9, &raw),
        ];
        field(5, &parts.concat())
    };
    let insert = |body: &mut Vec<u8>| {
        // The writer's last node gives the residuals; now the bomb's last node does.
        let found = body.windows(9).position(|w| w == b"residuals");
        let at = found.expect("the node that gives the residuals");
        body[at..at + 9].copy_from_slice(b"residualz");
        body.extend(vector("tall", length, 1));
        body.extend(vector("wide", 1, length));
        body.extend(node("MatMul", &["tall", "wide"], "huge"));
        body.extend(node("ReduceSum", &["huge"], "nothing"));
        body.extend(node("Add", &["residualz", "nothing"], "residuals"));
    };
    change("an outer product of 4 GiB", "differs from it", &insert);
    change("an unused outer product", "one too many", &|body| {
        body.extend(node("MatMul", &["tall", "wide"], "huge"));
    });
    change("an unused stored tensor", "one too many", &|body| {
        body.extend(vector("tall", length, 1));
    });
    change("140 million numbers", "numbers, more than", &|body| {
        let zeros = field(9, &vec![0; 140_000_000]);
        let size = [8, 0x80, 0xf6, 0xe0, 0x42];
        body.extend(field(
            5,
            &[&size[..], &[16, 3], &field(8, b"z"), &zeros].concat(),
        ));
    });

    // The right graph with another person's numbers.
    let mut edit = |what: &str, reason: &str, tensor: &str, value: [u8; 4]| {
        let mut broken = parts.clone();
        let graph = broken.member(GRAPH);
        let at = raw_data(graph, tensor);
        assert_ne!(graph[at..at + 4], value, "{what} changes nothing");
        graph[at..at + 4].copy_from_slice(&value);
        court.refuse(what, &broken.rehash().pack(), reason);
    };
    let own = "template and controllers";
    for tensor in ["attr.mass0", "attr.mass2", "skin.weights"] {
        edit(tensor, own, tensor, 0.25f32.to_le_bytes());
    }
    for (tensor, index) in [
        ("attr.neighbour0", 11i32),
        ("attr.neighbour1", -1),
        ("attr.neighbour2", i32::MAX),
    ] {
        edit(tensor, own, tensor, index.to_le_bytes());
    }
    for (tensor, size) in [
        ("mesh.planes.shape", 9i32),
        ("attr.rows.shape", -1),
        ("skin.rest1.from", 5),
        ("attr.axes", 0),
    ] {
        edit(tensor, own, tensor, size.to_le_bytes());
    }
    let far = 7.5f32.to_le_bytes();
    edit("a vertex elsewhere", "mean offset", "mesh.canonical", far);
    edit(
        "fields of kilometres",
        "decoder unit",
        "mesh.decoder.unit",
        1e30f32.to_le_bytes(),
    );
    edit(
        "bases beyond measure",
        "basis unit",
        "attr.bases.units",
        1e30f32.to_le_bytes(),
    );

    // Another person's graph with all the same sizes.
    let mut other = Puppet::small();
    let masses = other
        .controllers
        .masses()
        .iter()
        .map(|[a, b, c]| [*c, *a, *b]);
    other.controllers = Controllers::new(
        &other.template,
        other.controllers.vertices().to_vec(),
        other.controllers.neighbours().to_vec(),
        masses.collect(),
    )
    .expect("the masses still sum to 1");
    let mut broken = parts.clone();
    *broken.member(GRAPH) = other
        .graph()
        .to_onnx(spmm3::networks::GraphParts::Whole)
        .expect("the networks fit");
    court.refuse("another's graph", &broken.rehash().pack(), own);

    // A later operator set, under which the same nodes may mean something else.
    let mut broken = parts.clone();
    *broken.member(GRAPH).last_mut().expect("bytes") = 18;
    court.refuse("another operator set", &broken.rehash().pack(), "field 8");
}
