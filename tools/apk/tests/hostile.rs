//! Manifests and resources that somebody spoilt: refused with a reason, or packaged so that Android's own program reads them.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use apk::{ApkError, Contents, Signer};
use common::{contents, tools};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// What is put into a text at random places, besides single characters.
const PIECES: [&str; 16] = [
    "\"",
    "<",
    ">",
    "/>",
    "&",
    "&amp;",
    "&#0;",
    "]]>",
    "<!--",
    "<![CDATA[x]]>",
    "@string/",
    "@",
    "\\u12",
    "xmlns:a=\"b\"",
    "\u{feff}",
    "𝄞",
];

/// What is done to a text: at a place, so many characters are replaced by something.
fn changes() -> impl Strategy<Value = Vec<(prop::sample::Index, usize, String)>> {
    let insert = prop_oneof![
        prop::sample::select(&PIECES[..]).prop_map(str::to_owned),
        any::<char>().prop_map(String::from),
        Just(String::new())
    ];
    prop::collection::vec((any::<prop::sample::Index>(), 0_usize..12, insert), 1..4)
}

fn spoil(text: &str, changes: &[(prop::sample::Index, usize, String)]) -> String {
    let mut characters: Vec<char> = text.chars().collect();
    for (place, length, insert) in changes {
        let place = place.index(characters.len());
        let end = (place + length).min(characters.len());
        characters.splice(place..end, insert.chars());
    }
    characters.into_iter().collect()
}

/// What becomes of the fixture with these changes to its manifest: the package, or the error.
fn package_spoilt(
    folder: &Path,
    changes: &[(prop::sample::Index, usize, String)],
) -> Result<PathBuf, ApkError> {
    let signer = Signer::debug(&folder.join("debug.pem")).expect("a debug key");
    let path = folder.join("test.apk");
    let whole = contents();
    let manifest = spoil(&whole.manifest, changes);
    let spoilt = Contents {
        manifest,
        resources: whole.resources,
        ..Contents::default()
    };
    apk::write(&spoilt, &signer, &path).map(|_| path)
}

#[test]
fn whatever_spoilt_manifest_is_packaged_aapt_reads() {
    let Some(tools) = tools() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut runner = TestRunner::new(ProptestConfig::with_cases(200));
    let result = runner.run(&changes(), |changes| {
        if let Ok(path) = package_spoilt(folder.path(), &changes) {
            let tree = tools.dump(&["xmltree"], &path, Some("AndroidManifest.xml"));
            prop_assert!(tree.contains("E: application"), "{}", tree);
        }
        Ok(())
    });
    result.unwrap_or_else(|error| panic!("{error}"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_spoilt_manifest_is_packaged_or_refused_by_line(changes in changes()) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        if let Err(error) = package_spoilt(folder.path(), &changes) {
            prop_assert!(error.to_string().starts_with("AndroidManifest.xml:"), "{}", error);
            prop_assert!(!folder.path().join("test.apk").exists());
        }
    }

    #[test]
    fn spoilt_strings_are_refused_by_line_or_packaged(changes in changes()) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let signer = Signer::debug(&folder.path().join("debug.pem")).expect("a debug key");
        let values = folder.path().join("res/values");
        fs::create_dir_all(&values).expect("a folder");
        let text = fs::read_to_string(common::fixture().join("res/values/strings.xml")).expect("the fixture");
        fs::write(values.join("strings.xml"), spoil(&text, &changes)).expect("a file");
        let manifest = "<manifest xmlns:android='http://schemas.android.com/apk/res/android' package='a.b'>
            <uses-sdk android:minSdkVersion='29' android:targetSdkVersion='32'/><application/></manifest>";
        let spoilt = Contents { manifest: manifest.into(), resources: Some(folder.path().join("res")), ..Contents::default() };
        if let Err(error) = apk::write(&spoilt, &signer, &folder.path().join("test.apk")) {
            let error = error.to_string();
            prop_assert!(error.contains("strings.xml"), "{}", error);
        }
    }
}
