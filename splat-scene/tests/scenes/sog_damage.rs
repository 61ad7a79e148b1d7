//! SOG: zips, descriptions and images with false statements.

use serde_json::json;
use splat_scene::Scene;
use zip::CompressionMethod::{Deflated, Stored};

use crate::damage::{message, raws};
use crate::sog_writer::{Members, bundle, members, sog, webp, with_member, with_meta};

fn three() -> Members {
    members(&raws(3, 3), 2)
}

fn refused(members: &Members) -> String {
    message(&bundle(members, Stored), "x.sog")
}

#[test]
fn descriptions_that_lie_are_refused() {
    type Change = fn(&mut serde_json::Value);
    let cases: [(Change, &str); 12] = [
        (|meta| meta["count"] = json!(4_194_305), "4194305 Gaussians"),
        (
            |meta| meta["count"] = json!(4_194_304),
            "pixels for 4194304 Gaussians",
        ),
        (|meta| meta["count"] = json!(-1), "not the meta.json"),
        (|meta| meta["count"] = json!(null), "how many Gaussians"),
        (
            |meta| meta["version"] = json!(3),
            "version 3 cannot be read",
        ),
        (
            |meta| meta["scales"]["codebook"] = json!([]),
            "codebook of 0 values",
        ),
        (
            |meta| meta["sh0"]["codebook"] = json!(vec![0; 257]),
            "codebook of 257 values",
        ),
        (
            |meta| meta["means"]["files"] = json!(["means_l.webp"]),
            "too few images",
        ),
        (
            |meta| meta["means"]["mins"] = json!([0, 1]),
            "bounds of the positions",
        ),
        (|meta| meta["shN"]["bands"] = json!(4), "SH degree 4"),
        (
            |meta| meta["shN"]["bands"] = json!(2),
            "64 entries of SH degree 2",
        ),
        (
            |meta| meta["quats"]["files"] = json!(["other.webp"]),
            "its member other.webp",
        ),
    ];
    for (change, what) in cases {
        let text = refused(&with_meta(three(), change));
        assert!(text.contains(what), "{what} in: {text}");
    }
    let text = refused(&with_meta(members(&raws(3, 3), 1), |meta| {
        meta["sh0"]["maxs"] = json!([1, 2, 3]);
    }));
    assert!(text.contains("bounds"), "{text}");
}

#[test]
fn a_description_names_files_beside_it_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    for (name, content) in three() {
        std::fs::write(inner.join(&name), &content).unwrap();
        std::fs::write(folder.path().join(&name), &content).unwrap();
    }
    Scene::load(inner.join("meta.json")).expect("the scene is sound");
    for name in [
        "../quats.webp",
        "/etc/passwd",
        "inner/quats.webp",
        "",
        ".",
        "..",
        "./quats.webp",
    ] {
        let changed = with_meta(three(), |meta| meta["quats"]["files"] = json!([name]));
        std::fs::write(inner.join("meta.json"), &changed.last().unwrap().1).unwrap();
        let text = Scene::load(inner.join("meta.json"))
            .unwrap_err()
            .to_string();
        assert!(text.contains("no plain name"), "{name}: {text}");
    }
}

#[test]
fn images_that_are_not_the_scenes_are_refused() {
    let small = webp(&[[0, 0, 0, 252]; 2], 1);
    let large = webp(&vec![[0, 0, 0, 252]; 300 * 300], 300);
    let mut lossy = b"RIFF\x16\0\0\0WEBPVP8 \x0a\0\0\0\x10\0\0\x9d\x01\x2a".to_vec();
    lossy.extend([3, 0, 1, 0]);
    let cases = [
        (small, "quats.webp has 2 pixels for 3 Gaussians"),
        (large, "300 x 300 pixels, more than"),
        (lossy, "no lossless WebP"),
        (
            b"\x89PNG\r\n\x1a\n".to_vec(),
            "quats.webp cannot be decoded",
        ),
        (Vec::new(), "quats.webp cannot be decoded"),
    ];
    for (image, what) in cases {
        let text = refused(&with_member(three(), "quats.webp", image));
        assert!(text.contains(what), "{what} in: {text}");
    }
    let label = [[0, 1, 0, 255]; 3];
    let text = refused(&with_member(three(), "shN_labels.webp", webp(&label, 3)));
    assert!(
        text.contains("SH label 256, which is not in the palette"),
        "{text}"
    );
}

#[test]
fn a_gaussian_without_a_rotation_is_left_out() {
    let pixels = [[128, 128, 128, 252], [0, 0, 0, 251], [128, 128, 128, 255]];
    let members = with_member(three(), "quats.webp", webp(&pixels, 3));
    let scene = Scene::read(&bundle(&members, Stored), "x.sog").unwrap();
    assert_eq!(
        (scene.len(), scene.dropped().rotation),
        (2, 1),
        "by its tag"
    );
}

#[test]
fn a_first_value_that_older_writers_left_out_is_put_in() {
    let scales = webp(&[[0, 1, 2, 255]; 3], 3);
    let members = with_member(three(), "scales.webp", scales);
    let members = with_meta(members, |meta| {
        let steps: Vec<f64> = (0..256)
            .map(|index| f64::from(index) / 51.0 - 6.0)
            .collect();
        meta["scales"]["codebook"] = json!(steps);
        meta["scales"]["codebook"][0] = json!(null);
    });
    let scene = Scene::read(&bundle(&members, Stored), "x.sog").unwrap();
    let [first, second, _] = scene.log_scales()[0];
    // As PlayCanvas' engine does it: one 255th of the range below the second.
    assert!(
        (first - (second - 254.0 / 51.0 / 255.0)).abs() < 1e-5,
        "{first} and {second}"
    );
}

#[test]
fn members_that_unpack_to_more_than_they_may_are_refused() {
    let bomb = vec![b' '; 64 << 20];
    let members = with_member(three(), "meta.json", bomb.clone());
    let text = message(&bundle(&members, Deflated), "bomb.sog");
    assert!(
        text.contains("its member meta.json has more than 1048576 bytes"),
        "{text}"
    );
    let members = with_member(three(), "sh0.webp", bomb);
    let text = message(&bundle(&members, Deflated), "bomb.sog");
    assert!(text.contains("its member sh0.webp has more than"), "{text}");
}

#[test]
fn zips_that_lie_are_refused() {
    let file = sog(&raws(3, 3), 2);
    // The end record states more members than there is room for.
    let mut many = file.clone();
    let end = many.len() - 22;
    many[end + 8..end + 12].fill(0xff);
    let text = message(&many, "many.sog");
    assert!(text.contains("65535 members"), "{text}");
    let mut trailing = file.clone();
    trailing.extend([0; 4]);
    assert!(
        message(&trailing, "x.sog").contains("no directory at its end"),
        "bytes after it"
    );
    // The directory's place is left to a record of 64 bits, which states any number of members.
    let mut wide = file.clone();
    wide[end + 16..end + 20].fill(0xff);
    let text = message(&wide, "wide.sog");
    assert!(text.contains("directory is not where"), "{text}");
    // The last record has a comment that is not there, so that a reader would take an earlier one.
    let mut earlier = file.clone();
    let mut record = file[end..].to_vec();
    record[20] = 1;
    earlier.extend(record);
    let text = message(&earlier, "earlier.sog");
    assert!(text.contains("no directory at its end"), "{text}");
    // A member's content changed: the zip has a checksum of it.
    let mut flipped = file.clone();
    let at = file.windows(4).position(|bytes| bytes == b"RIFF").unwrap() + 20;
    flipped[at] ^= 1;
    assert!(
        message(&flipped, "x.sog").contains("cannot be read"),
        "its checksum"
    );
    let other = bundle(&[("notes.txt".to_owned(), b"hello".to_vec())], Stored);
    assert!(
        message(&other, "notes.zip").contains("a zip without a meta.json"),
        "another zip"
    );
    let other = bundle(&[("meta.json".to_owned(), b"[1, 2]".to_vec())], Stored);
    assert!(
        message(&other, "notes.zip").contains("not the meta.json of a SOG"),
        "another meta.json"
    );
    let json = br#"{"hello": 1}"#;
    assert!(
        message(json, "x.json").contains("images are not here"),
        "no folder"
    );
}
