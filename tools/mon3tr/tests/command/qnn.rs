//! `mon3tr bake --qnn`: a package with its deform graph compiled for the Quest 3's NPU.

use crate::support::{Outcome, command, json, mon3tr, puppet, text};
use npu_runtime::{QNN_VARIABLE, QnnTarget};
use spmm3::Avatar;
use test_support::onnx::{runtime, runtime_with_qnn};

#[test]
fn bake_compiles_a_packages_graph_for_the_npu_and_keeps_the_plain_one() {
    if runtime_with_qnn().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    let path = |name: &str| folder.path().join(name);
    let (out, figures) = (path("new/compiled.m3a"), path("figures.json"));
    mon3tr(&[
        "bake",
        "--qnn",
        "sxr2230p",
        "--avatar",
        text(&package),
        "--out",
        text(&out),
        "--json",
        text(&figures),
    ])
    .succeeds();
    let plain = Avatar::load(&package).expect("the package it came from");
    let avatar = Avatar::load(&out).expect("the package it wrote");
    let [compiled] = &avatar.compiled[..] else {
        panic!("{} compiled graphs", avatar.compiled.len());
    };
    assert_eq!(
        compiled.target.parse(),
        Ok(QnnTarget::SXR2230P),
        "the runtime knows the target by the package's name for it"
    );
    assert_eq!(
        json(&figures)["compiled"]["bytes"],
        compiled.onnx.len(),
        "the figures"
    );
    assert!(
        avatar.deform_graph == plain.deform_graph,
        "the plain graph changed"
    );
    let shown = mon3tr(&["inspect", text(&out)]).succeeds();
    for word in ["deform.onnx", "deform.qnn-sxr2230p.onnx", "compiled"] {
        assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
    }
}

#[test]
fn bake_says_at_once_what_it_lacks_to_compile_for_an_npu() {
    mon3tr(&["bake", "--qnn", "hexagon"]).fails_naming(&["hexagon", "sxr2230p"]);
    if runtime().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("never.m3a");
    // Without raw material a bake would end with that; it must not get so far.
    Outcome::of(
        command(&["bake", "--qnn", "sxr2230p", "--out", text(&out)])
            .env(QNN_VARIABLE, folder.path().join("nowhere"))
            .env("MON3TR_MAKEHUMAN", folder.path().join("nothing")),
    )
    .fails_naming(&["sxr2230p", "nowhere", QNN_VARIABLE]);
    assert!(!out.exists(), "something was written");
}
