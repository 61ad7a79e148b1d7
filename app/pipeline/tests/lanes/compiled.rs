//! Whose graphs, compiled for the NPU, are run: on QNN's emulator.

use crate::stage::avatar;
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::inference::Inference;
use identity::{Identity, PublicKey};
use npu_runtime::{Origin, Provider, ProviderKind, QnnTarget, Runtime};
use spmm3::Avatar;
use spmm3::networks::{CompiledGraph, GraphParts};
use std::path::Path;
use std::sync::Arc;
use test_support::onnx::runtime_with_qnn;

const TARGET: QnnTarget = QnnTarget::SXR2230P;

#[test]
fn only_a_package_that_a_trusted_key_signed_brings_its_compiled_graph() {
    let Some(runtime) = runtime_with_qnn() else {
        return;
    };
    let [me, friend, stranger] =
        [1, 2, 3].map(|seed| Identity::from_seed(&[seed; 32]).expect("a key"));
    let mut whole = avatar();
    whole.compiled.push(CompiledGraph {
        target: TARGET.name().to_owned(),
        onnx_runtime: runtime.version().to_owned(),
        onnx: npu_runtime::compile(&runtime, &whole.deform_graph, TARGET).expect("compiled"),
    });
    let folder = tempfile::tempdir().expect("a folder");
    let package = |signer: Option<&Identity>| {
        let path = folder.path().join("package.m3a");
        let written = match signer {
            Some(signer) => whole.save_signed(&path, signer),
            None => whole.save(&path),
        };
        written.expect("it packs");
        let read = Avatar::load(&path).expect("a sound package");
        assert_eq!(read.compiled, whole.compiled, "it brings the graph");
        read
    };
    let [mine, friends, strangers, nobodys] =
        [Some(&me), Some(&friend), Some(&stranger), None].map(package);
    let (me, friend) = (me.public(), friend.public());
    // In one cache throughout, which a graph that came with a package must not get into.
    let cache = folder.path().join("cache");
    let open = |avatar: &Avatar, trusted: &[PublicKey]| origin(&runtime, avatar, trusted, &cache);

    assert_eq!(open(&mine, &[me]), Origin::Precompiled, "signed by me");
    assert_eq!(open(&friends, &[me, friend]), Origin::Precompiled, "listed");
    assert!(!cache.exists(), "what came in a package was kept");
    assert_eq!(open(&friends, &[me]), Origin::Compiled, "not listed");
    assert_eq!(
        open(&strangers, &[me, friend]),
        Origin::Cached,
        "a stranger's"
    );
    assert_eq!(open(&nobodys, &[me, friend]), Origin::Cached, "unsigned");
    assert_eq!(open(&mine, &[]), Origin::Cached, "nobody is trusted");
}

/// Which form of the avatar's graph runs.
fn origin(runtime: &Runtime, avatar: &Avatar, trusted: &[PublicKey], cache: &Path) -> Origin {
    let provider = Provider::Qnn { target: TARGET };
    let sources = CompiledSources {
        cache: Some(cache.to_owned()),
        trusted: trusted.to_vec(),
    };
    let avatar = Arc::new(avatar.clone());
    let graph = GraphParts::Whole;
    let inference = Inference::open(runtime, &avatar, graph, &[provider], &sources);
    let inference = inference.expect("QNN takes the graph in either form");
    let (landing, origin) = inference.landing();
    assert!(landing.is_wholly_on(ProviderKind::Qnn), "on the NPU");
    origin
}
