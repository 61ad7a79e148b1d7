//! `mon3tr bake --qnn`: a package with its deform graph compiled for the Quest 3's NPU.

use crate::support::{Outcome, command, json, mon3tr, puppet, text};
use identity::Identity;
use npu_runtime::{QNN_VARIABLE, QnnTarget};
use spmm3::Avatar;
use test_support::onnx::{runtime, runtime_with_qnn};
use test_support::vulkan::gpu;

/// The command that compiles the graph of the package at `plain` for the Quest 3.
fn bake<'a>(plain: &'a str, compiled: &'a str) -> [&'a str; 7] {
    [
        "bake", "--qnn", "sxr2230p", "--avatar", plain, "--out", compiled,
    ]
}

#[test]
fn bake_compiles_a_packages_graph_for_the_npu_and_keeps_the_plain_one() {
    if runtime_with_qnn().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    let path = |name: &str| folder.path().join(name);
    let (out, figures) = (path("new/compiled.m3a"), path("figures.json"));
    let told = ["--json", text(&figures)];
    mon3tr(&[&bake(text(&package), text(&out))[..], &told].concat()).succeeds();
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
    let shown = mon3tr(&["keys"]).succeeds();
    let signer = avatar.signer.expect("whoever compiled it has signed it");
    assert!(shown.contains(&signer.to_string()), "{shown}");
    let shown = mon3tr(&["inspect", text(&out)]).succeeds();
    for word in ["deform.onnx", "deform.qnn-sxr2230p.onnx", "compiled"] {
        assert!(shown.contains(word), "`{word}` is missing in:\n{shown}");
    }
}

#[test]
fn whoever_signs_a_package_does_not_vouch_for_anothers_compiled_graph() {
    if runtime_with_qnn().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    let compiled = folder.path().join("compiled.m3a");
    let (plain, compiled) = (text(&package), text(&compiled));
    mon3tr(&bake(plain, compiled)).succeeds();
    let baked = Avatar::load(compiled.as_ref()).expect("the package");
    // One's own signature stays, and the graph with it.
    mon3tr(&["keys", "sign", compiled]).succeeds();
    let signed = Avatar::load(compiled.as_ref()).expect("the package");
    assert_eq!(signed.compiled, baked.compiled, "one's own graph");
    // A stranger takes the signature off.
    baked.save(compiled.as_ref()).expect("it packs");
    let said = mon3tr(&["keys", "sign", compiled]).succeeds();
    assert!(said.contains("left out"), "{said}");
    let signed = Avatar::load(compiled.as_ref()).expect("the package");
    assert_eq!(signed.signer, baked.signer, "signed again");
    assert!(signed.compiled.is_empty(), "without the stranger's graph");
}

#[test]
fn a_strangers_compiled_graph_is_used_from_when_their_key_is_trusted_until_it_is_not() {
    if gpu().is_none() || runtime_with_qnn().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = puppet(&folder);
    let path = |name: &str| folder.path().join(name);
    let (out, figures, cache) = (path("compiled.m3a"), path("p.json"), path("cache"));
    let (trace, page) = (path("trace.json"), path("profile.html"));
    // Another user of another machine bakes and signs.
    let stranger = path("stranger");
    let bake = bake(text(&package), text(&out));
    Outcome::of(command(&bake).env("MON3TR_KEY", &stranger)).succeeds();
    let key = Avatar::load(&out).expect("the package").signer;
    let key = key.expect("it is signed").to_string();
    let as_me = |arguments: &[&str]| {
        let mut command = command(arguments);
        command
            .env("MON3TR_KEY", path("me"))
            .env("MON3TR_CACHE", &cache);
        Outcome::of(&mut command)
    };
    let profile = [
        "profile",
        text(&out),
        "--placement",
        "npu,npu=qnn",
        "--seconds",
        "1",
        "--size",
        "96x64",
        "--json",
        text(&figures),
        "--trace",
        text(&trace),
        "--page",
        text(&page),
    ];
    let used = || {
        as_me(&profile).succeeds();
        json(&figures)["placement"]["graph"].clone()
    };
    // A profile drives the avatar too, which another list is for.
    let mine = Identity::open(&path("me")).expect("a key").public();
    let allow = ["keys", "allow", &mine.to_string()];
    let permit = Outcome::of(command(&allow).env("MON3TR_KEY", &stranger)).succeeds();
    let permit = permit.split_once("keys accept ").expect("a permit").1;
    as_me(&["keys", "accept", permit.trim()]).succeeds();
    assert_eq!(used(), "compiled", "a stranger's is compiled here");
    as_me(&["keys", "trust", &key]).succeeds();
    assert!(as_me(&["keys"]).succeeds().contains(&key), "it is listed");
    assert_eq!(used(), "precompiled", "one that is trusted");
    as_me(&["keys", "trust", &key, "--remove"]).succeeds();
    as_me(&["keys", "trust", &key, "--remove"]).fails_naming(&["was not trusted"]);
    assert_eq!(used(), "cached", "what was compiled here before");
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
