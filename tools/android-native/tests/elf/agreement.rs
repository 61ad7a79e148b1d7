//! The check's reader against binutils' readelf.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use android_native::elf::{Library, Platform, Undefined, check_library};
use android_native::parts;

use crate::fixture::{read, workshop};

/// What readelf prints; nothing, after a line that says so, where there is none. On CI that is a failure.
fn readelf(arguments: &[&str], file: &Path) -> Option<String> {
    match Command::new("readelf").args(arguments).arg(file).output() {
        Ok(output) => {
            assert!(
                output.status.success(),
                "readelf {arguments:?} {}",
                file.display()
            );
            Some(String::from_utf8_lossy(&output.stdout).into_owned())
        }
        Err(error) => {
            let why = format!("readelf does not run ({error}): it comes with a C compiler");
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "{why}, and CI must have it"
            );
            println!("skipped: {why}");
            None
        }
    }
}

/// Everything that the check reads, as readelf prints it.
fn assert_agrees(library: &Library, file: &Path) -> Option<()> {
    let name = &library.name;
    let dynamic = readelf(&["--dynamic", "--wide"], file)?;
    let bracketed = |tag: &str| -> Vec<String> {
        dynamic
            .lines()
            .filter(|line| line.contains(tag))
            .filter_map(|line| Some(line.split_once('[')?.1.split_once(']')?.0.to_owned()))
            .collect()
    };
    assert_eq!(library.needed, bracketed("(NEEDED)"), "{name} needs");
    assert_eq!(
        library.soname.iter().cloned().collect::<Vec<_>>(),
        bracketed("(SONAME)"),
        "{name}'s own name"
    );
    assert_eq!(
        library.text_relocations,
        dynamic.contains("TEXTREL"),
        "{name}"
    );
    let segments = readelf(&["--program-headers", "--wide"], file)?;
    let alignments: Vec<u64> = segments
        .lines()
        .filter(|line| line.trim_start().starts_with("LOAD"))
        .filter_map(|line| line.rsplit_once("0x")?.1.trim().parse_hex())
        .collect();
    assert_eq!(library.alignments, alignments, "{name}'s alignments");
    let header = readelf(&["--file-header"], file)?;
    assert_eq!(library.is_aarch64(), header.contains("AArch64"), "{name}");
    assert_eq!(library.shared, header.contains("DYN"), "{name}");
    let table = readelf(&["--dyn-syms", "--wide"], file)?;
    let (mut undefined, mut exports) = (BTreeSet::new(), BTreeSet::new());
    for line in table.lines() {
        // Number, value, size, type, binding, visibility, section, name@version.
        let words: Vec<&str> = line.split_whitespace().collect();
        let [
            number,
            _,
            _,
            _,
            binding @ ("GLOBAL" | "WEAK"),
            _,
            section,
            symbol,
            ..,
        ] = words[..]
        else {
            continue;
        };
        assert!(number.ends_with(':'), "{line}");
        let symbol = symbol.split('@').next().unwrap_or_default().to_owned();
        if section == "UND" {
            undefined.insert(Undefined {
                name: symbol,
                weak: binding == "WEAK",
            });
        } else {
            exports.insert(symbol);
        }
    }
    assert_eq!(library.undefined, undefined, "{name} expects");
    assert_eq!(library.exports, exports, "{name} exports");
    Some(())
}

trait ParseHex {
    fn parse_hex(&self) -> Option<u64>;
}

impl ParseHex for str {
    fn parse_hex(&self) -> Option<u64> {
        u64::from_str_radix(self, 16).ok()
    }
}

#[test]
fn another_reader_reads_the_same_of_a_library_linked_here() {
    let Some(shop) = workshop() else { return };
    for (name, options) in [
        ("libone.so", &["-znow"][..]),
        (
            "libtwo.so",
            &["-zmax-page-size=4096", "--pack-dyn-relocs=relr"],
        ),
    ] {
        let data = shop.link(
            name,
            &["android_main", "other"],
            &["getpid", "dlopen"],
            &["libc.so", "libdl.so"],
            options,
        );
        assert_agrees(&read(name, &data), &shop.path(name));
    }
}

#[test]
fn another_reader_reads_the_same_of_others_libraries_and_android_loads_them() {
    let Some(folder) = std::env::var_os(parts::PARTS).map(PathBuf::from) else {
        let why = "there is no MON3TR_ANDROID_PARTS (./run test sets it)";
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "{why}, and CI must have it"
        );
        println!("skipped: {why}");
        return;
    };
    let parts = parts::read(&folder).unwrap_or_else(|error| panic!("{error}"));
    assert!(parts.len() >= 2, "OpenXR's loader and ONNX Runtime");
    for part in parts {
        let library = read(&part.file, &part.data);
        if assert_agrees(&library, &folder.join(&part.file)).is_none() {
            return;
        }
        assert_eq!(
            check_library(&library, &[], &Platform::api_29(), None),
            [],
            "{}",
            part.file
        );
    }
}
