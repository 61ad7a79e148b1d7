//! What is in the package.

use crate::built::{built, shown};
use crate::tools::{android, apk, output_of, skip, variable};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

const REPO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// Libraries that the app opens by name while it runs.
const OPENED: [&str; 3] = ["libopenxr_loader.so", "libonnxruntime.so", "libvulkan.so"];

/// The words in quotes after `key` on every line of `aapt`'s output that begins with it.
fn quoted<'a>(said: &'a str, key: &str) -> BTreeSet<&'a str> {
    said.lines()
        .filter_map(|line| line.trim().strip_prefix(key)?.split('\'').nth(1))
        .collect()
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn aapt_reads_an_app_for_quest_in_it() {
    let Some(built) = built() else { return };
    let Some(mut aapt) = android("aapt") else {
        return;
    };
    let said = output_of(aapt.args(["dump", "badging"]).arg(&built.file));
    for line in [
        "package: name='org.mon3tr.quest'",
        "sdkVersion:'29'",
        "targetSdkVersion:'32'",
        "native-code: 'arm64-v8a'",
        "application-label:'Mon3tr'",
        "launchable-activity: name='android.app.NativeActivity'",
        "application-debuggable",
    ] {
        assert!(
            said.lines().any(|found| found.starts_with(line)),
            "{line} in:\n{said}"
        );
    }
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn the_packaged_manifest_has_every_entry_that_quest_needs() {
    let Some(built) = built() else { return };
    let Some(mut aapt) = android("aapt") else {
        return;
    };
    let said = output_of(
        aapt.args(["dump", "xmltree"])
            .arg(&built.file)
            .arg("AndroidManifest.xml"),
    );
    for value in [
        "android.intent.category.LAUNCHER",
        "com.oculus.intent.category.VR",
        "org.khronos.openxr.intent.category.IMMERSIVE_HMD",
        "android.hardware.vr.headtracking",
        "com.oculus.feature.PASSTHROUGH",
        "com.oculus.supportedDevices",
        "quest3|quest3s|questpro|quest2",
        "com.oculus.vr.focusaware",
        "android.app.lib_name",
        "org.khronos.openxr.runtime_broker;org.khronos.openxr.system_runtime_broker",
        "libcdsprpc.so",
    ] {
        assert!(
            said.contains(&format!("\"{value}\"")),
            "{value} in:\n{said}"
        );
    }
    // Of the build, beside what the manifest's own text says.
    for value in [
        "org.mon3tr.build.route",
        "without an NDK: rust-lld and the symbols of Android API 29",
        "org.mon3tr.build.commit",
        "org.mon3tr.part.libonnxruntime.so",
    ] {
        assert!(
            said.contains(&format!("\"{value}\"")),
            "{value} in:\n{said}"
        );
    }
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn its_permissions_are_exactly_the_documented_ones() {
    let Some(built) = built() else { return };
    let Some(mut aapt) = android("aapt") else {
        return;
    };
    let said = output_of(aapt.args(["dump", "permissions"]).arg(&built.file));
    let page = std::fs::read_to_string(Path::new(REPO).join("docs/android.md")).expect("the page");
    let documented: BTreeSet<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(name, _)| name)
        .filter(|name| name.contains(".permission."))
        .collect();
    assert!(!documented.is_empty(), "docs/android.md lists permissions");
    assert_eq!(quoted(&said, "uses-permission: "), documented);
    // None under another heading, such as one for some versions of Android.
    let all = said
        .lines()
        .filter(|line| line.contains("permission"))
        .count();
    assert_eq!(all, documented.len(), "{said}");
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn the_licences_of_all_that_it_is_made_of_are_in_it() {
    let Some(built) = built() else { return };
    let Some(mut aapt) = android("aapt") else {
        return;
    };
    let listed = output_of(aapt.arg("list").arg(&built.file));
    for name in [
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "crates.txt",
        "libraries.txt",
        "notices.txt",
        "onnxruntime.txt",
    ] {
        let name = format!("assets/licences/{name}");
        assert!(listed.lines().any(|line| line == name), "{name}: {listed}");
    }
    let about = Path::new(REPO).join("android/licences.txt");
    let about = std::fs::read_to_string(about).expect("the licences of libraries");
    for (name, ..) in built.libraries() {
        let is_told = about.contains(&name) || name == "libmain.so";
        assert!(is_told, "android/licences.txt says nothing of {name}");
    }
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn zipalign_finds_it_aligned_and_libraries_start_on_pages_of_16_kib() {
    let Some(built) = built() else { return };
    for (name, _, start) in built.libraries() {
        assert!(start.is_multiple_of(0x4000), "{name} starts at {start:#x}");
    }
    let Some(mut zipalign) = android("zipalign") else {
        return;
    };
    output_of(zipalign.args(["-c", "-p", "4"]).arg(&built.file));
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn apksigner_verifies_it_and_names_the_certificate_that_the_command_names() {
    let Some(built) = built() else { return };
    let Some(mut apksigner) = android("apksigner") else {
        return;
    };
    // For Android from 7.0 on: later ones read the third scheme alone.
    let arguments = ["verify", "-v", "--print-certs", "--min-sdk-version", "24"];
    let said = output_of(apksigner.args(arguments).arg(&built.file));
    for scheme in ["Scheme v2): true", "Scheme v3): true"] {
        assert!(said.contains(scheme), "{scheme} in:\n{said}");
    }
    let digest = built.report["certificate_sha256"].as_str().expect("a hash");
    assert!(said.contains(digest), "{digest} in:\n{said}");
    assert!(built.said.contains(digest), "{digest} in:\n{}", built.said);
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn every_library_that_is_needed_or_opened_is_in_it_or_androids() {
    let Some(built) = built() else { return };
    let libraries = built.libraries();
    let inside: BTreeSet<&str> = libraries.iter().map(|(name, ..)| name.as_str()).collect();
    let list = Path::new(REPO).join("tools/android-native/api-29/libraries.txt");
    let platform = std::fs::read_to_string(list).expect("the list");
    let platform: BTreeSet<&str> = platform.lines().collect();
    let place = built.place("needed");
    for (name, data, _) in &libraries {
        let file = place.join(name);
        std::fs::write(&file, data).expect("a file");
        let mut readelf = Command::new("readelf");
        let output = match readelf.args(["--dynamic", "--wide"]).arg(&file).output() {
            Ok(output) => output,
            Err(error) => return skip(&format!("readelf does not run ({error})")),
        };
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let needed: Vec<&str> = said
            .lines()
            .filter(|line| line.contains("(NEEDED)"))
            .filter_map(|line| line.split(['[', ']']).nth(1))
            .collect();
        assert!(needed.contains(&"libc.so"), "{name}: {said}");
        for needed in needed {
            assert!(
                inside.contains(needed) || platform.contains(needed),
                "{name} needs {needed}"
            );
        }
    }
    for opened in OPENED {
        assert!(
            inside.contains(opened) || platform.contains(opened),
            "{opened} is there"
        );
    }
    let reported: BTreeSet<&str> = built.report["libraries"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|row| row["file"].as_str())
        .collect();
    assert_eq!(reported, inside, "what the report lists");
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn it_has_60_megabytes_at_most() {
    let Some(built) = built() else { return };
    let bytes = built.bytes().len();
    assert!(bytes <= 60_000_000, "{bytes} bytes");
    assert_eq!(built.report["bytes"].as_u64(), Some(bytes as u64));
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn no_path_of_this_machine_is_in_its_library_and_names_for_backtraces_lie_beside_it() {
    let Some(built) = built() else { return };
    let libraries = built.libraries();
    let (_, own, _) = libraries
        .iter()
        .find(|(name, ..)| name == "libmain.so")
        .expect("the app's own");
    let repo = Path::new(REPO).canonicalize().expect("the repository");
    let symbols = std::fs::read(built.file.with_extension("symbols.so")).expect("beside it");
    assert!(!contains(own, shown(&repo).as_bytes()), "{repo:?}");
    assert!(!contains(own, b"/.cargo/registry"), "crates' sources");
    // Most of an unstripped library is for debuggers.
    assert!(
        own.len() * 2 < symbols.len(),
        "it is stripped, these are not"
    );
}

fn contains(data: &[u8], wanted: &[u8]) -> bool {
    data.windows(wanted.len()).any(|window| window == wanted)
}

/// The package without its signatures: what is before them, and the zip's directory after them.
fn unsigned(apk: &[u8]) -> (&[u8], &[u8]) {
    let number = |at: usize, bytes: usize| {
        apk[at..at + bytes]
            .iter()
            .rev()
            .fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte))
    };
    let end = apk.len() - 22;
    let directory = number(end + 16, 4);
    let block = directory - 8 - number(directory - 24, 8);
    (&apk[..block], &apk[directory..end])
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn two_packages_of_one_build_are_the_same_but_for_their_signatures() {
    let Some(built) = built() else { return };
    let place = built.place("twice");
    let again = place.join("two.apk");
    // Its own folder has another key.
    output_of(&mut apk(&place, &["--out", &shown(&again)]));
    let (one, two) = (built.bytes(), std::fs::read(&again).expect("the package"));
    assert_ne!(one, two, "two keys");
    assert!(unsigned(&one) == unsigned(&two), "the rest is the same");
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn the_parts_in_it_are_the_ones_that_were_fetched() {
    let Some(built) = built() else { return };
    let Some(folder) = variable("MON3TR_ANDROID_PARTS") else {
        return;
    };
    let others: Vec<_> = built
        .libraries()
        .into_iter()
        .filter(|(name, ..)| name != "libmain.so")
        .collect();
    assert!(others.len() >= 2, "OpenXR's loader and ONNX Runtime");
    for (name, data, _) in others {
        assert!(
            std::fs::read(folder.join(&name)).expect("what was fetched") == data,
            "{name}"
        );
    }
}
