//! A damaged file is refused with the reason and the remedy, before memory is allocated by its counts; and single Gaussians that
//! cannot be drawn are counted.

use splat_scene::{Dropped, MAX_GAUSSIANS, MAX_LOG_SCALE, Scene, SceneError};

use crate::expected::Raw;
use crate::harmonics::raw;
use crate::sog_writer::sog;
use crate::spz4_writer::spz4;
use crate::writers::{self, Dress};

pub(crate) fn raws(count: u8, coefficients: usize) -> Vec<Raw> {
    let mut random = fastrand::Rng::with_seed(11);
    (0..count)
        .map(|at| raw(&mut random, coefficients, f32::from(at)))
        .collect()
}

/// The file with one piece of its text header put in place of another.
fn with(file: &[u8], old: &str, new: &str) -> Vec<u8> {
    let at = file
        .windows(old.len())
        .position(|window| window == old.as_bytes())
        .expect("the header has it");
    [&file[..at], new.as_bytes(), &file[at + old.len()..]].concat()
}

pub(crate) fn message(file: &[u8], name: &str) -> String {
    let error = Scene::read(file, name).expect_err("the file is not sound");
    let message = error.to_string();
    assert!(message.contains(name), "the file is named: {message}");
    assert!(message.contains("; "), "there is advice: {message}");
    message
}

#[test]
fn gaussians_that_cannot_be_drawn_are_counted_by_reason() {
    let mut all = raws(10, 3);
    all[0].position[1] = f32::NAN;
    all[1].position[2] = f32::NEG_INFINITY;
    all[2].rotation = [0.0; 4];
    all[3].rotation[0] = f32::INFINITY;
    all[4].log_scale[0] = 1e3;
    all[5].opacity = f32::NAN;
    all[6].rest[2][1] = f32::NAN;
    // These can: a scale of nothing, and a quaternion of another length.
    all[7].log_scale[2] = f32::NEG_INFINITY;
    all[8].rotation = all[8].rotation.map(|v| v * 1e-4);
    for dress in [Dress::Plain, Dress::Text] {
        let scene = Scene::read(&writers::ply(&all, dress), "x").unwrap();
        let expected = Dropped {
            position: 2,
            rotation: 2,
            scale: 1,
            opacity: 1,
            colour: 1,
        };
        assert_eq!(scene.dropped(), expected, "each for its reason");
        assert_eq!(scene.len(), 3, "the others are kept");
        assert_eq!(
            scene.log_scales()[0][2],
            -MAX_LOG_SCALE,
            "no scale is a small scale"
        );
    }
    let text = Scene::read(&writers::ply(&all, Dress::Plain), "x")
        .unwrap()
        .dropped()
        .to_string();
    assert!(
        text.starts_with("2 for their position, 2 for their rotation"),
        "in words: {text}"
    );
}

#[test]
fn counts_beyond_the_limit_are_refused_by_their_header() {
    let over = format!("element vertex {}", MAX_GAUSSIANS + 1);
    for file in [
        writers::ply(&raws(3, 0), Dress::Plain),
        writers::compressed_ply(&raws(3, 0), true),
    ] {
        let text = message(&with(&file, "element vertex 3", &over), "big.ply");
        assert!(text.contains("4194305 Gaussians"), "{text}");
        let text = message(
            &with(
                &file,
                "element vertex 3",
                "element vertex 18446744073709551615",
            ),
            "big.ply",
        );
        assert!(text.contains("18446744073709551615 Gaussians"), "{text}");
        let text = message(
            &with(
                &file,
                "element vertex 3",
                "element vertex 99999999999999999999",
            ),
            "big.ply",
        );
        assert!(text.contains("`99999999999999999999`"), "{text}");
    }
    let mut payload = writers::spz_payload(&raws(3, 0), 3, 12, 0);
    payload[8..12].fill(0xff);
    let text = message(&writers::gzip(&payload), "big.spz");
    assert!(text.contains("4294967295 Gaussians"), "{text}");
    let text = message(
        &writers::splat(&raws(1, 0)).repeat(MAX_GAUSSIANS + 1),
        "big.splat",
    );
    assert!(text.contains("4194305 Gaussians"), "{text}");
}

#[test]
fn promises_that_the_data_does_not_keep_are_truncations() {
    let most = MAX_GAUSSIANS.to_string();
    let ply = writers::ply(&raws(3, 15), Dress::Plain);
    let text = message(
        &with(&ply, "vertex 3", &format!("vertex {most}")),
        "cut.ply",
    );
    assert!(
        text.contains("would take 989855744 bytes, 708 are there"),
        "{text}"
    );
    let compressed = writers::compressed_ply(&raws(3, 3), true);
    let text = message(
        &with(&compressed, "chunk 1", "chunk 18446744073709551615"),
        "cut.ply",
    );
    assert!(text.contains("element `chunk`"), "{text}");
    let text = message(&with(&compressed, "vertex 3", "vertex 700"), "cut.ply");
    assert!(text.contains("would take"), "{text}");
    let text = message(&with(&compressed, "sh 3", "sh 2"), "cut.ply");
    assert!(text.contains("`sh` has 2 rows for 3 Gaussians"), "{text}");
    let mut payload = writers::spz_payload(&raws(3, 3), 2, 12, 0);
    payload[8..12].copy_from_slice(&4_000_000_u32.to_le_bytes());
    for file in [writers::gzip(&payload), payload] {
        let text = message(&file, "cut.spz");
        assert!(
            text.contains("would take 112000000 bytes, 84 are there"),
            "{text}"
        );
    }
    let splat = writers::splat(&raws(3, 0));
    let text = message(&splat[..95], "cut.splat");
    assert!(text.contains("ends too early"), "{text}");
}

#[test]
fn every_truncation_of_each_format_is_an_error() {
    let payload = writers::spz_payload(&raws(3, 3), 3, 12, 0);
    let files = [
        writers::ply(&raws(3, 3), Dress::Plain),
        writers::compressed_ply(&raws(3, 3), true),
        writers::gzip(&payload),
        payload,
        spz4(&raws(3, 3), 12, 0),
        sog(&raws(3, 3), 1),
        sog(&raws(3, 3), 2),
    ];
    for file in files {
        for length in 0..file.len() {
            let error = Scene::read(&file[..length], "cut");
            assert!(
                error.is_err(),
                "{length} of {} bytes are no scene",
                file.len()
            );
        }
        Scene::read(&file, "whole").expect("the whole file is");
    }
}

#[test]
fn a_gzip_bomb_is_not_unpacked() {
    let mut payload = writers::spz_payload(&raws(3, 0), 3, 12, 0);
    payload.resize(64 << 20, 0);
    let text = message(&writers::gzip(&payload), "bomb.spz");
    assert!(text.contains("goes on after the last Gaussian"), "{text}");
    let text = message(&writers::gzip(&vec![0; 64 << 20]), "bomb.gz");
    assert!(text.contains("not of an .spz scene"), "{text}");
}

#[test]
fn a_wrong_checksum_is_noticed() {
    let mut file = writers::gzip(&writers::spz_payload(&raws(3, 0), 3, 12, 0));
    let at = file.len() - 6;
    file[at] ^= 1;
    assert!(
        message(&file, "flipped.spz").contains("gzip stream"),
        "the checksum's bytes were changed"
    );
}

#[test]
fn content_that_is_no_scene_is_told_so() {
    for (file, name) in [
        (&b""[..], "empty.ply"),
        (b"\x89PNG\r\n\x1a\n", "picture.ply"),
        (b"<!DOCTYPE html><html><p>404</p>", "page.splat"),
        (&[0xff; 3200], "noise.bin"),
        (&[0; 3200], "zeros.splat"),
    ] {
        let text = message(file, name);
        assert!(text.contains(name), "{text}");
    }
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 property uchar red\nend_header\n0 0 0 255\n";
    let text = message(cloud.as_bytes(), "cloud.ply");
    assert!(
        text.contains("no property `f_dc_0`: a plain cloud of points"),
        "{text}"
    );
    let big_endian = with(&writers::ply(&raws(1, 0), Dress::Plain), "little", "big");
    let text = message(&big_endian, "big-endian.ply");
    assert!(text.contains("binary_big_endian"), "{text}");
    let degree4 = with(
        &writers::ply(&raws(1, 8), Dress::Plain),
        "f_rest_23",
        "f_rest_29",
    );
    let text = message(&degree4, "odd.ply");
    assert!(text.contains("23 properties `f_rest_`"), "{text}");
}

#[test]
fn a_splat_file_is_told_by_its_content_and_may_be_damaged_by_its_name() {
    let mut file = writers::splat(&raws(9, 0));
    Scene::read(&file, "download.bin").expect("its content shows what it is");
    file[..12].fill(0xff);
    let error = Scene::read(&file, "download.bin").expect_err("one record is none");
    assert!(matches!(error, SceneError::UnknownFormat { .. }), "{error}");
    let scene = Scene::read(&file, "garden.splat").expect("its name says what it is");
    assert_eq!(
        (scene.len(), scene.dropped().position),
        (8, 1),
        "one is left out"
    );
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nowhere.ply");
    let text = Scene::load(&path).unwrap_err().to_string();
    assert!(
        text.contains("nowhere.ply") && text.contains("; check"),
        "{text}"
    );
    let text = Scene::load(folder.path()).unwrap_err().to_string();
    assert!(text.contains("cannot read"), "a folder is no file: {text}");
    std::fs::write(&path, writers::splat(&raws(2, 0))).unwrap();
    assert_eq!(
        Scene::load(&path).unwrap().len(),
        2,
        "its content counts, not its name"
    );
}
