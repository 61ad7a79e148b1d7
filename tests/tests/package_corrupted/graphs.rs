//! Deform graphs that want more than a deform graph may.

use crate::Court;
use crate::parts::{GRAPH, Parts};

/// One protobuf field of bytes.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let mut out = vec![number << 3 | 2];
    let mut length = content.len();
    while length > 0x7f {
        out.push(length.to_le_bytes()[0] | 0x80);
        length >>= 7;
    }
    out.push(length.to_le_bytes()[0]);
    out.extend(content);
    out
}

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
            change("a number that is none", "not finite", &|graph| {
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
        change("a half that is none", "not finite", &|graph| {
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
