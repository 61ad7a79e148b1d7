//! What the command refuses before it builds anything.

use crate::built::shown;
use crate::tools::{android, apk, text};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What `mon3tr-dev apk` with `arguments` and `variables` says, which must fail without a panic.
fn refusal(arguments: &[&str], variables: &[(&str, &Path)]) -> String {
    let folder = TempDir::new().expect("a folder");
    let mut command = apk(folder.path(), arguments);
    for (name, value) in variables {
        command.env(name, value);
    }
    let out = folder.path().join("never.apk");
    let output = command.arg("--out").arg(&out).output().expect("it starts");
    let said = text(&output);
    assert!(!output.status.success(), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert!(!said.contains("building"), "{said}");
    assert!(!out.is_file(), "nothing is packaged");
    let line = said.lines().find(|line| line.starts_with("error:"));
    line.unwrap_or_else(|| panic!("no line starts with `error:` in:\n{said}"))
        .to_owned()
}

#[test]
fn a_variable_that_names_no_ndk_is_named_in_the_error() {
    let folder = TempDir::new().expect("a folder");
    let said = refusal(&[], &[("ANDROID_NDK_HOME", folder.path())]);
    assert!(said.contains("ANDROID_NDK_HOME"), "{said}");
    assert!(said.contains("source.properties"), "{said}");
}

#[test]
fn missing_parts_are_named_with_the_command_that_fetches_them() {
    let folder = TempDir::new().expect("a folder");
    let compiler = folder.path().join("clang");
    std::fs::write(&compiler, "").expect("a file");
    let variables = [
        ("MON3TR_CLANG", compiler.as_path()),
        ("MON3TR_ANDROID_PARTS", folder.path()),
    ];
    let said = refusal(&[], &variables);
    assert!(said.contains("parts.json"), "{said}");
    assert!(said.contains("./run setup"), "{said}");
    std::fs::write(folder.path().join("parts.json"), "[]").expect("a file");
    let nowhere = folder.path().join("nowhere");
    let [one, two] = variables;
    let said = refusal(
        &["--with-qnn"],
        &[one, two, ("MON3TR_ANDROID_PARTS_QNN", &nowhere)],
    );
    assert!(said.contains("Maven Central"), "{said}");
    assert!(said.contains("./run apk --with-qnn"), "{said}");
}

/// What stands in for a clang and for others' libraries until something is built, in `folder`.
fn stand_ins(folder: &Path) -> [(&'static str, PathBuf); 2] {
    let compiler = folder.join("clang");
    std::fs::write(&compiler, "").expect("a file");
    std::fs::write(folder.join("parts.json"), "[]").expect("a file");
    [
        ("MON3TR_CLANG", compiler),
        ("MON3TR_ANDROID_PARTS", folder.to_owned()),
    ]
}

#[test]
fn missing_programs_are_named_with_the_ways_to_get_them() {
    let folder = TempDir::new().expect("a folder");
    let [clang, parts] = stand_ins(folder.path());
    let said = refusal(
        &[],
        &[
            (clang.0, &clang.1),
            (parts.0, &parts.1),
            ("MON3TR_ANDROID_TOOLS", folder.path()),
        ],
    );
    for word in ["aapt2", "./run apk", "ANDROID_HOME"] {
        assert!(said.contains(word), "{word} in: {said}");
    }
}

#[test]
fn a_file_that_is_no_key_store_is_named() {
    if android("apksigner").is_none() {
        return;
    }
    let folder = TempDir::new().expect("a folder");
    let [clang, parts] = stand_ins(folder.path());
    let store = folder.path().join("clang");
    let said = refusal(
        &["--keystore", &shown(&store), "--key-pass", "secret"],
        &[(clang.0, &clang.1), (parts.0, &parts.1)],
    );
    assert!(said.contains(&shown(&store)), "{said}");
    assert!(said.contains("cannot be read as a key store"), "{said}");
    assert!(!said.contains("secret"), "{said}");
}

#[test]
fn a_key_store_that_is_not_there_is_named() {
    let said = refusal(&["--keystore", "nowhere.p12", "--key-pass", "secret"], &[]);
    assert!(said.contains("nowhere.p12"), "{said}");
    assert!(!said.contains("secret"), "{said}");
}
