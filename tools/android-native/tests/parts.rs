//! Others' libraries: only what was fetched is packaged.

use std::fs;

use android_native::parts::{hash, read};

fn list(sha256: &str, file: &str) -> String {
    format!(
        r#"[{{"file": "{file}", "version": "1.2", "from": "https://example.org/a.aar", "sha256": "{sha256}"}}]"#
    )
}

#[test]
fn a_library_is_read_with_what_is_known_of_it() {
    let folder = tempfile::tempdir().expect("a folder");
    // The hash of nothing, as FIPS 180-4's test vectors have it.
    let sha256 = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
    fs::write(folder.path().join("libone.so"), "").expect("a file");
    fs::write(folder.path().join("parts.json"), list(sha256, "libone.so")).expect("a file");
    let parts = read(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(parts.len(), 1);
    assert_eq!((&*parts[0].file, &*parts[0].version), ("libone.so", "1.2"));
    assert_eq!(parts[0].sha256, sha256);
    assert!(!parts[0].for_npu, "Android loads it");
}

#[test]
fn a_library_that_was_changed_or_is_missing_or_lies_elsewhere_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |word: &str| {
        let error = read(folder.path())
            .expect_err("nothing to package")
            .to_string();
        assert!(error.contains(word), "{error}");
        assert!(error.contains("./run setup"), "{error}");
    };
    refused("parts.json");
    let good = hash(b"good");
    fs::write(folder.path().join("parts.json"), list(&good, "libone.so")).expect("a file");
    refused("libone.so");
    fs::write(folder.path().join("libone.so"), "bad").expect("a file");
    refused(&good);
    fs::write(
        folder.path().join("parts.json"),
        list(&good, "../libone.so"),
    )
    .expect("a file");
    refused("no file name");
    fs::write(folder.path().join("parts.json"), "[{]").expect("a file");
    refused("parts.json");
}
