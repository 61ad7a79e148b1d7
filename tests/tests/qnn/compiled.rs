//! Compiled forms of a graph: kept, used again, made again when damaged, and never used for another chip.

use super::session;
use npu_runtime::{Graph, Origin, Precompiled, ProviderKind, QnnTarget, RuntimeError, Session};
use spmm3::networks::GraphParts;
use std::path::{Path, PathBuf};
use synthetic_person::{Puppet, Random};
use test_support::onnx::runtime_with_qnn;

#[test]
fn a_graph_is_compiled_once_and_again_when_its_cache_is_damaged() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    let puppet = Puppet::small();
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cache = folder.path().join("qnn");
    let open = |model: &[u8]| {
        let graph = Graph {
            onnx: model,
            cache: Some(&cache),
            ..Graph::default()
        };
        session(&runtime, &puppet, graph).expect("QNN takes the graph")
    };

    let mut first = open(&model);
    assert_eq!(first.origin(), Origin::Compiled, "nothing was there");
    let entry = only_file(&cache);
    let kept = std::fs::read(&entry).expect("the entry");
    let stamp = modified(&entry);
    let expected = run(&mut first);

    let mut second = open(&model);
    assert_eq!(second.origin(), Origin::Cached, "it was kept");
    assert!(second.landing().is_wholly_on(ProviderKind::Qnn), "strictly");
    assert!(run(&mut second) == expected, "the same graph");
    assert_eq!(only_file(&cache), entry, "nothing was added");
    assert_eq!(modified(&entry), stamp, "the entry was not written again");

    let mut damaged = kept.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(&entry, &damaged).expect("a writable folder");
    let mut third = open(&model);
    assert_eq!(third.origin(), Origin::Compiled, "the damage was seen");
    assert!(run(&mut third) == expected, "the same graph");
    assert_eq!(only_file(&cache), entry, "the damaged one was replaced");
    assert!(
        std::fs::read(&entry).expect("the entry") != damaged,
        "what replaced it is whole"
    );
    assert_eq!(open(&model).origin(), Origin::Cached, "and is used");

    // Valid by its own hash, but QNN cannot load it.
    let mut foreign = kept[..kept.len().min(40)].to_vec();
    foreign.extend_from_slice(b"another program's");
    std::fs::write(&entry, foreign).expect("a writable folder");
    assert_eq!(open(&model).origin(), Origin::Compiled, "a foreign file");

    let other = Puppet::new(synthetic_person::PuppetSize {
        bases: 4,
        ..synthetic_person::PuppetSize::SMALL
    });
    let other = other
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    assert_eq!(open(&other).origin(), Origin::Compiled, "another graph");
    let entries = std::fs::read_dir(&cache).expect("the cache").count();
    assert_eq!(entries, 2, "each graph has its own entry");
}

#[test]
fn a_precompiled_graph_needs_no_plain_one_and_serves_no_other_chip() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    let puppet = Puppet::small();
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    let target = QnnTarget::SXR2230P;
    let compiled = npu_runtime::compile(&runtime, &model, target).expect("QNN compiles it");
    let ours = [Precompiled {
        target,
        onnx: &compiled,
    }];
    let mut alone = session(
        &runtime,
        &puppet,
        Graph {
            precompiled: &ours,
            ..Graph::default()
        },
    )
    .expect("the compiled form is enough");
    assert_eq!(alone.origin(), Origin::Precompiled, "which form");
    assert!(alone.landing().is_wholly_on(ProviderKind::Qnn), "strictly");
    let expected = run(&mut session(&runtime, &puppet, (&model).into()).expect("plain"));
    assert!(run(&mut alone) == expected, "the same graph");

    let error = session(&runtime, &puppet, Graph::default()).expect_err("no form at all");
    assert!(matches!(error, RuntimeError::Target { .. }), "{error}");

    // The compiler notes architecture and chip (69:53) in what it makes; here another chip's are put in their place.
    let other = replaced(&compiled, b":69:53:", b":73:43:");
    let elsewhere = [Precompiled {
        target,
        onnx: &other,
    }];
    let graph = Graph {
        precompiled: &elsewhere,
        ..Graph::default()
    };
    let error = session(&runtime, &puppet, graph).expect_err("compiled for another chip");
    let text = error.to_string();
    assert!(matches!(error, RuntimeError::Target { .. }), "{text}");
    for word in ["43", "V73", "sxr2230p", "bake --qnn"] {
        assert!(text.contains(word), "`{word}` is missing in: {text}");
    }
    let graph = Graph {
        onnx: &model,
        ..graph
    };
    let session = session(&runtime, &puppet, graph).expect("the plain graph is there too");
    assert_eq!(
        session.origin(),
        Origin::Compiled,
        "it was compiled instead"
    );
}

/// The graph's outputs for one motion.
fn run(session: &mut Session) -> Vec<f32> {
    let motion = Random::new(1).motion(0.6);
    session.input_mut(0).copy_from_slice(motion.values());
    let mut outputs = session.outputs().expect("memory for them");
    session.run(&mut outputs).expect("the graph runs");
    outputs.get(1).to_vec()
}

fn only_file(folder: &Path) -> PathBuf {
    let files: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the cache")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files[0].clone()
}

fn modified(file: &Path) -> std::time::SystemTime {
    std::fs::metadata(file)
        .and_then(|m| m.modified())
        .expect("the entry")
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len(), "lengths stay");
    let at = bytes.windows(from.len()).position(|w| w == from);
    let at = at.expect("the compiler's note");
    let mut out = bytes.to_vec();
    out[at..at + to.len()].copy_from_slice(to);
    out
}

#[test]
fn compiling_leaves_this_threads_arithmetic_unchanged() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    let puppet = Puppet::small();
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    npu_runtime::compile(&runtime, &model, QnnTarget::SXR2230P).expect("QNN takes the graph");
    let denormal = std::hint::black_box(f32::MIN_POSITIVE) * std::hint::black_box(0.5);
    assert!(denormal > 0.0, "denormal numbers are flushed to zero");
}
