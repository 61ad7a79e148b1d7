//! Damage to the archive itself, zip tricks and bombs.

use crate::Court;
use crate::parts::{GRAPH, MANIFEST, Parts, TEMPLATE, hash, pack};
use serde_json::json;
use sha2::{Digest, Sha256};
use std::io::{Cursor, Write};
use synthetic_person::Random;
use zip::write::SimpleFileOptions;

/// Little-endian patches of a zip's records, found by their signatures.
fn records(package: &[u8], signature: &[u8; 4]) -> Vec<usize> {
    (0..package.len() - 4)
        .filter(|at| package[*at..].starts_with(signature))
        .collect()
}

const LOCAL: &[u8; 4] = b"PK\x03\x04";
const CENTRAL: &[u8; 4] = b"PK\x01\x02";
const END: &[u8; 4] = b"PK\x05\x06";

pub(crate) fn flips_and_cuts(court: &mut Court, package: &[u8], random: &mut Random) {
    for _ in 0..120 {
        let mut broken = package.to_vec();
        let (at, bit) = (random.below(broken.len()), random.below(8));
        broken[at] ^= 1 << bit;
        court.read(&format!("a flip of bit {bit} at byte {at}"), &broken);
    }
    assert!(
        court.harmless < 6,
        "{} of 120 flips changed nothing: is anything checked?",
        court.harmless
    );
    // The directory and the records around the members, where a random flip seldom lands.
    let directory = records(package, CENTRAL)[0];
    for _ in 0..60 {
        let mut broken = package.to_vec();
        let at = directory + random.below(broken.len() - directory);
        broken[at] ^= 1 << random.below(8);
        court.read(&format!("a flip in the directory at {at}"), &broken);
    }
    for _ in 0..40 {
        let length = random.below(package.len());
        let cut = &package[..length];
        court.refuse(&format!("a cut to {length} bytes"), cut, "package");
    }
    for length in [0, 1, 21, 22, 41, 42, package.len() - 1] {
        court.refuse("a cut", &package[..length], "package");
    }
}

pub(crate) fn wrong_archives(court: &mut Court, package: &[u8], parts: &Parts) {
    let manifest = (
        MANIFEST.to_owned(),
        serde_json::to_vec(&parts.manifest).expect("json"),
    );
    let files = [vec![manifest], parts.members.clone()].concat();
    let with = |name: &str, bytes: &[u8]| {
        let extra = (name.to_owned(), bytes.to_vec());
        pack(&[files.clone(), vec![extra]].concat())
    };
    for name in [
        "/etc/passwd",
        "../up",
        "a/b",
        "C:\\x",
        "folder/",
        ".hidden",
        "a\0b",
        &"n".repeat(200),
    ] {
        court.refuse(
            &format!("a member {name:?}"),
            &with(name, b"x"),
            "unusable name",
        );
    }
    court.refuse(
        "an unlisted member",
        &with("notes.txt", b"x"),
        "manifest lists",
    );
    court.refuse(
        "a nested package",
        &with("inner.m3a", package),
        "manifest lists",
    );
    let mut listed = parts.clone();
    let extra = json!({"name": "notes.txt", "bytes": 1, "sha256": hash(b"x"), "tensors": {}});
    listed.manifest["members"]
        .as_array_mut()
        .expect("a list")
        .push(extra);
    listed.members.push(("notes.txt".into(), b"x".to_vec()));
    court.refuse(
        "a listed but unknown member",
        &listed.pack(),
        "a package holds",
    );
    for missing in 0..files.len() {
        let mut fewer = files.clone();
        let (name, _) = fewer.remove(missing);
        court.refuse(&format!("no {name}"), &pack(&fewer), "package");
    }
    let crowd: Vec<(String, Vec<u8>)> = (0..17).map(|k| (format!("m{k}"), vec![])).collect();
    court.refuse("17 members", &pack(&crowd), "at most 16");
    let crowd: Vec<(String, Vec<u8>)> = (0..60_000).map(|k| (format!("m{k}"), vec![])).collect();
    court.refuse("60,000 members", &pack(&crowd), "at most 16");

    // Two members under one name: written apart, renamed in the bytes.
    let twin = with("deform.onny", b"second");
    let mut broken = twin.clone();
    for at in 0..broken.len() - 11 {
        if broken[at..].starts_with(b"deform.onny") {
            broken[at..at + 11].copy_from_slice(b"deform.onnx");
        }
    }
    court.refuse("two members of one name", &broken, "duplicate");

    let (local, central) = (records(package, LOCAL), records(package, CENTRAL));
    let end = records(package, END)[0];
    let mut patch = |what: &str, at: usize, value: &[u8]| {
        let mut broken = package.to_vec();
        broken[at..at + value.len()].copy_from_slice(value);
        court.refuse(what, &broken, "package");
    };
    for (entry, size) in [
        (0, 1u32),
        (1, 7),
        (2, u32::MAX),
        (5, 400 << 20),
        (5, 0),
        (4, u32::MAX - 1),
    ] {
        let size = size.to_le_bytes();
        patch("a size in the directory", central[entry] + 24, &size);
        patch("a packed size in the directory", central[entry] + 20, &size);
        patch("a size in the local header", local[entry] + 22, &size);
        patch(
            "a packed size in the local header",
            local[entry] + 18,
            &size,
        );
    }
    patch("a wrong checksum", central[3] + 16, &[1, 2, 3, 4]);
    patch("an encrypted member", central[2] + 8, &[1]);
    patch("an unknown method", central[2] + 10, &[99]);
    patch("a stored member that is deflated", central[2] + 10, &[0]);
    patch("a member outside the file", central[2] + 42, &[0xff; 4]);
    let first = u32::try_from(local[1]).expect("small").to_le_bytes();
    patch("two entries for one member", central[2] + 42, &first);
    patch("65,535 entries", end + 8, &[0xff; 4]);
    patch("a directory of 4 GiB", end + 12, &[0xff; 4]);
    patch("a directory outside the file", end + 16, &[0xff; 4]);
    patch("a second disk", end + 4, &[1]);
    patch("a comment that is missing", end + 20, &[9]);
    let before = [b"#!/bin/sh\n", package].concat();
    court.refuse(
        "something before the archive",
        &before,
        "directory is not where",
    );
    let after = [package, b"more"].concat();
    court.refuse("something after the archive", &after, "no zip directory");
    let ends: Vec<u8> = package[end..].repeat(50_000);
    court.refuse("50,000 ends", &[package, &ends].concat(), "package");
    court.refuse(
        "a text file",
        &b"not a package at all\n".repeat(9),
        "no zip directory",
    );
}

/// Small files that unpack to a lot.
pub(crate) fn bombs(court: &mut Court, parts: &Parts) {
    let zeros = vec![0u8; 1 << 20];
    let mut bomb = |name: &str, mebibytes: usize, reason: &str, honest: bool| {
        let mut digest = Sha256::new();
        (0..mebibytes).for_each(|_| digest.update(&zeros));
        let digest: String = digest
            .finalize()
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        let mut lying = parts.clone();
        if honest && name != MANIFEST {
            lying.entry(name)["bytes"] = json!(mebibytes << 20);
            lying.entry(name)["sha256"] = json!(digest);
        }
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default();
        let manifest = serde_json::to_vec(&lying.manifest).expect("json");
        let manifest = (MANIFEST.to_owned(), manifest);
        for (member, bytes) in [&manifest].into_iter().chain(&lying.members) {
            zip.start_file(member.as_str(), options)
                .expect("a new member");
            if member == name {
                for _ in 0..mebibytes {
                    zip.write_all(&zeros).expect("memory");
                }
            } else {
                zip.write_all(bytes).expect("memory");
            }
        }
        let packed = zip.finish().expect("memory").into_inner();
        let what = format!("{mebibytes} MiB of nothing as {name}");
        court.refuse(&what, &packed, reason);
    };
    bomb(MANIFEST, 300, "more than the", true);
    bomb(TEMPLATE, 300, "more than the", false);
    bomb(TEMPLATE, 700, "unpacks to", true);
    bomb(TEMPLATE, 450, TEMPLATE, true);
    bomb(GRAPH, 450, GRAPH, true);
}
