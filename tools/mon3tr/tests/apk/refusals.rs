//! What the command refuses before it builds anything.

use crate::tools::{apk, text};
use std::path::Path;
use tempfile::TempDir;

/// What `mon3tr apk` with `arguments` and `variables` says, which must fail without a panic.
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

#[test]
fn a_key_store_that_is_not_there_is_named() {
    let said = refusal(&["--keystore", "nowhere.p12", "--key-pass", "secret"], &[]);
    assert!(said.contains("nowhere.p12"), "{said}");
    assert!(!said.contains("secret"), "{said}");
}
