//! Avatar packages: what is saved is what is loaded.

use glam::Vec3;
use identity::Identity;
use spmm3::package::Manifest;
use spmm3::{Avatar, ExpressionBasis, Importance, MotionParams, PARAMS, PackageError, PoseRange};
use std::io::{Cursor, Read, Write};
use synthetic_person::Puppet;

fn avatar() -> Avatar {
    Puppet::small().avatar()
}

#[test]
fn a_saved_avatar_loads_as_it_was_and_saves_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.m3a");
    let turned = MotionParams::new([0.1; PARAMS], Vec3::ZERO);
    let avatar = Avatar {
        pose_range: PoseRange::of([&turned, &MotionParams::default()]),
        ..avatar()
    };
    assert!(avatar.pose_range.is_some(), "a range to keep");
    let size = avatar.save(&path).expect("the puppet saves");
    let first = std::fs::read(&path).expect("the package is there");
    assert_eq!(first.len() as u64, size, "the size that save reports");
    let loaded = Avatar::load(&path).expect("the puppet loads");
    assert!(loaded == avatar, "loading changed the avatar");
    loaded.save(&path).expect("the loaded puppet saves over it");
    let second = std::fs::read(&path).expect("the package is still there");
    assert!(first == second, "the second save differs");
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .expect("the folder lists")
        .collect();
    assert_eq!(
        left.len(),
        1,
        "save left something beside the package: {left:?}"
    );
}

#[test]
fn an_avatar_in_full_precision_loads_rounded_as_quantised_says() {
    let puppet = Puppet::small();
    let gaussians = spmm3::BoundGaussians::bind(
        &puppet.template,
        &puppet.at_rest,
        puppet.gaussians.triangles().to_vec(),
        puppet.gaussians.barycentrics().to_vec(),
    )
    .expect("the Gaussians bind");
    let full = Avatar {
        gaussians,
        ..puppet.avatar()
    };
    let bytes = full.to_bytes().expect("the puppet packs");
    let loaded = Avatar::read(Cursor::new(bytes)).expect("the puppet loads");
    assert!(
        loaded != full,
        "nothing was rounded: the test proves nothing"
    );
    assert!(loaded == full.quantised(), "it is rounded otherwise");
}

#[test]
fn a_package_without_an_order_of_importance_loads_and_takes_the_larger_gaussians_first() {
    let mut avatar = avatar();
    avatar.importance = None;
    let bytes = avatar.to_bytes().expect("the puppet packs");
    let loaded = Avatar::read(Cursor::new(bytes)).expect("the puppet loads");
    assert!(loaded == avatar, "loading changed the avatar");
    let order = loaded.importance();
    assert_eq!(order, Importance::by_size(&avatar.gaussians), "the rule");
    assert_eq!(
        avatar.kept_levels(&[0.5])[0].kept.len(),
        1_000,
        "half of them"
    );
}

#[test]
fn the_manifest_alone_tells_what_is_in_a_package() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.m3a");
    let avatar = avatar();
    avatar.save(&path).expect("the puppet saves");
    let manifest = Manifest::load(&path).expect("the manifest loads");
    assert_eq!(manifest.name, avatar.name, "name");
    assert_eq!(manifest.licence, avatar.licence, "licence");
    assert_eq!(manifest.counts.gaussians, 2_000, "Gaussians");
    assert_eq!(manifest.counts.controllers, 16, "controllers");
    assert_eq!(manifest.counts.bases, Some(5), "bases");
    assert_eq!(manifest.report, avatar.report, "report");
    assert_eq!(manifest.basis(), avatar.expression_basis, "basis");
    let graph = manifest.member("deform.onnx").expect("the graph is listed");
    assert_eq!(graph.bytes, avatar.deform_graph.len() as u64, "graph size");
    assert_eq!(graph.tensors["residuals"].shape, [14, 2_000], "its output");
}

#[test]
fn an_avatar_whose_parts_do_not_fit_each_other_is_not_saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.m3a");
    avatar().save(&path).expect("the puppet saves");
    let before = std::fs::read(&path).expect("the package is there");
    let mut broken = avatar();
    let other = Puppet::new(synthetic_person::PuppetSize {
        gaussians: 1_000,
        ..synthetic_person::PuppetSize::SMALL
    });
    broken.gaussians = other.gaussians;
    broken.importance = None;
    let error = broken
        .save(&path)
        .expect_err("1,000 Gaussians on 2,000 ties");
    assert!(
        matches!(&error, PackageError::Member { member, .. } if member == "controllers.safetensors"),
        "{error}"
    );
    let after = std::fs::read(&path).expect("the package is still there");
    assert!(before == after, "a failed save touched the old package");
}

#[test]
fn a_missing_file_and_a_folder_are_distinguished_from_broken_packages() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = Avatar::load(&folder.path().join("puppet.m3a")).expect_err("there is none");
    assert!(matches!(error, PackageError::Missing), "{error:?}");
    assert!(error.to_string().contains("mon3tr bake"), "{error}");
    let error = Avatar::load(folder.path()).expect_err("it is a folder");
    assert!(matches!(error, PackageError::Folder), "{error:?}");
}

#[test]
fn an_avatars_expression_basis_is_kept_whatever_its_name() {
    let mut avatar = avatar();
    for name in ["mon3tr-makehuman-1", "flame-2020", "my-own.7"] {
        avatar.expression_basis = ExpressionBasis::new(name).expect("a good name");
        let bytes = avatar.to_bytes().expect("the puppet packs");
        let loaded = Avatar::read(Cursor::new(bytes)).expect("the puppet loads");
        assert_eq!(loaded.expression_basis, avatar.expression_basis, "{name}");
    }
}

/// The package with what `change` makes of its members, each told with its name; without those of which it makes nothing.
fn repacked(bytes: &[u8], change: impl Fn(&str, Vec<u8>) -> Option<Vec<u8>>) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).expect("a zip");
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).expect("a member");
        let name = String::from_utf8_lossy(member.name_raw()).into_owned();
        let mut contents = Vec::new();
        member.read_to_end(&mut contents).expect("it unpacks");
        if let Some(contents) = change(&name, contents) {
            let options = zip::write::SimpleFileOptions::default();
            zip.start_file(name, options).expect("a member");
            zip.write_all(&contents).expect("written");
        }
    }
    zip.finish().expect("a zip").into_inner()
}

#[test]
fn a_signed_package_tells_its_owner_and_nobody_else_can_sign_for_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.m3a");
    let [owner, other] = [1, 2].map(|seed| Identity::from_seed(&[seed; 32]).expect("a key"));
    avatar().save_signed(&path, &owner).expect("it saves");
    let signed = std::fs::read(&path).expect("the package");
    let read = |bytes: &[u8]| Avatar::read(Cursor::new(bytes.to_vec()));
    let loaded = read(&signed).expect("it loads");
    assert_eq!(loaded.signer, Some(owner.public()));
    let same = Avatar {
        signer: None,
        ..loaded.clone()
    };
    assert!(same == avatar(), "nothing else has changed");
    let manifest = Manifest::load(&path).expect("the manifest");
    assert_eq!(
        (manifest.signer, manifest.version),
        (Some(owner.public()), 3)
    );
    // As it is, it is read; with anything of it changed, it is not.
    assert!(read(&repacked(&signed, |_, bytes| Some(bytes))).is_ok());
    let renamed = repacked(&signed, |name, bytes| {
        let text = String::from_utf8_lossy(&bytes).replace(&avatar().name, "Eve");
        Some(if name == "manifest.json" {
            text.into_bytes()
        } else {
            bytes
        })
    });
    let others_key = repacked(&signed, |name, bytes| {
        let text = String::from_utf8_lossy(&bytes)
            .replace(&owner.public().to_string(), &other.public().to_string());
        Some(if name == "signature.txt" {
            text.into_bytes()
        } else {
            bytes
        })
    });
    let garbled = repacked(&signed, |name, bytes| {
        Some(if name == "signature.txt" {
            b"nobody".to_vec()
        } else {
            bytes
        })
    });
    let stripped = repacked(&signed, |name, bytes| {
        (name != "signature.txt").then_some(bytes)
    });
    for (what, bytes) in [
        ("another name", renamed),
        ("another key", others_key),
        ("no signature", garbled),
        ("none at all", stripped),
    ] {
        let refused = read(&bytes).expect_err(what);
        assert!(
            matches!(&refused, PackageError::Member { member, .. } if member == "signature.txt"),
            "{what}: {refused}"
        );
    }
    // Whoever takes it for their own signs the same contents: then it is theirs, and no longer the owner's.
    loaded.save_signed(&path, &other).expect("it saves");
    let taken = Avatar::load(&path).expect("it loads");
    assert_eq!(taken.signer, Some(other.public()));
}
