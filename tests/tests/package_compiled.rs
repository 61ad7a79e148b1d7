//! Deform graphs compiled for an NPU, in a package: kept beside the plain one, checked as far as possible, and absent
//! where none was made.

use npu_runtime::TensorSpec;
use spmm3::Avatar;
use spmm3::networks::CompiledGraph;
use spmm3::package::Manifest;
use std::io::Cursor;
use synthetic_person::Puppet;
use test_support::onnx::{field, whole_graph};

/// An attribute that is a text or bytes.
fn text(name: &str, value: &[u8]) -> Vec<u8> {
    [field(1, name.as_bytes()), field(4, value)].concat()
}

/// An attribute that is a number below 128.
fn number(name: &str, value: u8) -> Vec<u8> {
    [field(1, name.as_bytes()), vec![3 << 3, value]].concat()
}

/// The attributes that QNN writes.
fn attributes() -> Vec<Vec<u8>> {
    vec![
        number("main_context", 1),
        text("ep_cache_context", &[7; 300]),
        number("embed_mode", 1),
        text("ep_sdk_version", b"v2.51.0"),
        text("source", b"QNNExecutionProvider"),
    ]
}

fn port(spec: &TensorSpec) -> Vec<u8> {
    let varint = |mut size: usize| {
        let mut out = Vec::new();
        while size > 0x7f {
            out.push(size.to_le_bytes()[0] | 0x80);
            size >>= 7;
        }
        out.push(size.to_le_bytes()[0]);
        out
    };
    let dims: Vec<u8> = (spec.shape.iter())
        .flat_map(|size| field(1, &[vec![1 << 3], varint(*size)].concat()))
        .collect();
    let tensor = [vec![1 << 3, 1], field(2, &dims)].concat();
    [field(1, spec.name.as_bytes()), field(2, &field(1, &tensor))].concat()
}

fn node(operator: &str, domain: &str, attributes: &[Vec<u8>]) -> Vec<u8> {
    let (inputs, outputs) = whole_graph(1, 1);
    let names = |number: u8, ports: &[TensorSpec]| -> Vec<u8> {
        (ports.iter())
            .flat_map(|port| field(number, port.name.as_bytes()))
            .collect()
    };
    let attributes = attributes.iter().flat_map(|a| field(5, a)).collect();
    [
        names(1, &inputs),
        names(2, &outputs),
        field(4, operator.as_bytes()),
        field(7, domain.as_bytes()),
        attributes,
    ]
    .concat()
}

/// A model of `nodes` between the deform graph's inputs and outputs for N_v vertices and N_g Gaussians.
fn model(nodes: &[Vec<u8>], vertices: usize, gaussians: usize) -> Vec<u8> {
    let (inputs, outputs) = whole_graph(vertices, gaussians);
    let nodes = nodes.iter().flat_map(|node| field(1, node));
    let inputs = inputs.iter().flat_map(|spec| field(11, &port(spec)));
    let outputs = outputs.iter().flat_map(|spec| field(12, &port(spec)));
    let graph: Vec<u8> = nodes.chain(inputs).chain(outputs).collect();
    [vec![1 << 3, 13], field(7, &graph)].concat()
}

fn compiled(onnx: Vec<u8>) -> CompiledGraph {
    CompiledGraph {
        target: "sxr2230p".into(),
        onnx_runtime: "1.31.1".into(),
        onnx,
    }
}

#[test]
fn a_compiled_graph_comes_back_as_it_was_and_is_listed_with_its_target_and_versions() {
    // Without an order of importance either, which came with the same version.
    let plain = Avatar {
        importance: None,
        ..Puppet::small().avatar()
    };
    let before = plain.to_bytes().expect("the puppet packs");
    let (vertices, gaussians) = (plain.template.vertices().len(), plain.gaussians.len());
    let context = node("EPContext", "com.microsoft", &attributes());
    let avatar = Avatar {
        compiled: vec![compiled(model(&[context], vertices, gaussians))],
        ..plain.clone()
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.m3a");
    avatar.save(&path).expect("it packs");
    let loaded = Avatar::load(&path).expect("it loads");
    assert!(loaded == avatar, "loading changed the avatar");
    assert!(
        loaded.deform_graph == plain.deform_graph,
        "the plain graph is there too"
    );
    let manifest = Manifest::load(&path).expect("the manifest loads");
    assert_eq!(manifest.version, 2, "programs of before it say so");
    let entry = &manifest.compiled[0];
    assert_eq!(entry.target, "sxr2230p", "the chip");
    assert_eq!(entry.qnn, "v2.51.0", "QNN, as the graph itself says");
    assert_eq!(entry.onnx_runtime, "1.31.1", "ONNX Runtime");
    let member = manifest.member(&entry.member).expect("a listed member");
    assert_eq!(member.tensors.len(), 4, "its inputs and outputs");

    // Without one, packages are the same as before compiled graphs existed.
    let manifest = |bytes: &[u8]| {
        let path = folder.path().join("plain.m3a");
        std::fs::write(&path, bytes).expect("a writable folder");
        Manifest::load(&path).expect("the manifest loads")
    };
    assert_eq!(manifest(&before).version, 1, "programs of before read it");
    let again = Avatar {
        compiled: Vec::new(),
        ..loaded
    };
    assert!(
        again.to_bytes().expect("it packs") == before,
        "the compiled graph left a trace"
    );
}

#[test]
fn a_member_that_is_no_compiled_deform_graph_is_refused() {
    let plain = Puppet::small().avatar();
    let (vertices, gaussians) = (plain.template.vertices().len(), plain.gaussians.len());
    let context = |attributes: &[Vec<u8>]| node("EPContext", "com.microsoft", attributes);
    let refuse = |what: &str, onnx: Vec<u8>, reason: &str| {
        let avatar = Avatar {
            compiled: vec![compiled(onnx)],
            ..plain.clone()
        };
        let error = avatar.to_bytes().expect_err(what).to_string();
        assert!(error.contains(reason), "{what}: {error}");
        assert!(
            error.contains("deform.qnn-sxr2230p.onnx"),
            "{what}: {error}"
        );
    };
    let whole = |nodes: &[Vec<u8>]| model(nodes, vertices, gaussians);
    refuse(
        "the plain graph",
        plain.deform_graph.clone(),
        "compiled graph",
    );
    refuse("nothing", Vec::new(), "no graph");
    refuse("no node", whole(&[]), "EPContext");
    refuse(
        "another operator",
        whole(&[node("Add", "", &[])]),
        "EPContext",
    );
    refuse(
        "a foreign EPContext",
        whole(&[node("EPContext", "com.example", &attributes())]),
        "EPContext",
    );
    refuse(
        "two nodes",
        whole(&[context(&attributes()), node("Add", "", &[])]),
        "more than one node",
    );
    for (what, at, instead, reason) in [
        (
            "a file beside it",
            2,
            number("embed_mode", 0),
            "not embedded",
        ),
        (
            "no context",
            1,
            text("ep_cache_context", b""),
            "not embedded",
        ),
        (
            "another's context",
            0,
            number("main_context", 0),
            "not embedded",
        ),
        ("another compiler", 4, text("source", b"OpenVINO"), "by QNN"),
        (
            "no version",
            3,
            text("ep_sdk_version", b""),
            "which version",
        ),
        (
            "an odd version",
            3,
            text("ep_sdk_version", b"\x1b[2J"),
            "which version",
        ),
        (
            "an odd attribute",
            3,
            text("library", b"/tmp/x.so"),
            "library",
        ),
    ] {
        let mut changed = attributes();
        changed[at] = instead;
        refuse(what, whole(&[context(&changed)]), reason);
    }
    refuse(
        "another person's",
        model(&[context(&attributes())], vertices, gaussians + 1),
        "but the plain graph has",
    );
    let stored = field(7, &field(5, &field(8, b"w")));
    refuse("stored numbers", stored, "field 5");
    let cut = whole(&[context(&attributes())]);
    for keep in (1..cut.len()).step_by(7) {
        let avatar = Avatar {
            compiled: vec![compiled(cut[..keep].to_vec())],
            ..plain.clone()
        };
        assert!(avatar.to_bytes().is_err(), "cut to {keep} bytes");
    }

    let good = compiled(whole(&[context(&attributes())]));
    let several = |graphs: Vec<CompiledGraph>| {
        let avatar = Avatar {
            compiled: graphs,
            ..plain.clone()
        };
        avatar.to_bytes().map(drop).map_err(|e| e.to_string())
    };
    let twice = several(vec![good.clone(), good.clone()]).expect_err("one chip twice");
    assert!(twice.contains("two graphs"), "{twice}");
    for target in ["", "SXR", "a/b", "..", &"x".repeat(40)] {
        let odd = CompiledGraph {
            target: target.into(),
            ..good.clone()
        };
        let error = several(vec![odd]).expect_err("an unusable target");
        assert!(error.contains("unusable target"), "{target:?}: {error}");
    }
}

#[test]
fn a_damaged_compiled_graph_is_found_by_its_hash() {
    let plain = Puppet::small().avatar();
    let (vertices, gaussians) = (plain.template.vertices().len(), plain.gaussians.len());
    let context = node("EPContext", "com.microsoft", &attributes());
    let avatar = Avatar {
        compiled: vec![compiled(model(&[context], vertices, gaussians))],
        ..plain
    };
    let package = avatar.to_bytes().expect("it packs");
    let name = b"deform.qnn-sxr2230p.onnx";
    // The local header's name; its deflated bytes follow.
    let found = package.windows(name.len()).rposition(|w| w == name);
    let directory = found.expect("the directory's entry");
    let local = package[..directory]
        .windows(name.len())
        .rposition(|w| w == name);
    let at = local.expect("the member itself") + name.len() + 20;
    let mut damaged = package.clone();
    damaged[at] ^= 0x10;
    let error = Avatar::read(Cursor::new(damaged)).expect_err("a flipped bit");
    assert!(error.to_string().contains("qnn-sxr2230p"), "{error}");
}
