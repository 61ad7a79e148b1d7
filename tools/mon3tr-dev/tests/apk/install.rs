//! `--install`, with a stand-in for adb that notes what it is asked.

use crate::built::{Built, built, shown};
use crate::tools::{apk, text};
use std::path::{Path, PathBuf};

/// An adb that lists `devices` and answers an installation with `answer`; the folder it lies in.
fn fake_adb(place: &Path, devices: &str, answer: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt as _;
    let log = place.join("asked");
    let script = format!(
        "#!/bin/sh\nprintf '%s\\n' \"$*\" >>'{}'\ncase $* in\ndevices) printf 'List of devices attached\\n{devices}\\n' ;;\n\
         *' install '*) printf '%s\\n' '{answer}' ;;\nesac\n",
        log.display()
    );
    let adb = place.join("adb");
    std::fs::write(&adb, script).expect("a file");
    std::fs::set_permissions(&adb, std::fs::Permissions::from_mode(0o755)).expect("its mode");
    place.to_owned()
}

/// Builds (nothing is left to build), packages and installs with that adb; what was printed, whether it ended well, and what adb was
/// asked.
fn install(built: &Built, name: &str, devices: &str, answer: &str) -> (String, bool, Vec<String>) {
    let place = built.place(name);
    let folder = fake_adb(&place, devices, answer);
    let mut path = vec![folder];
    path.extend(std::env::split_paths(
        &std::env::var_os("PATH").unwrap_or_default(),
    ));
    let out = shown(&place.join("app.apk"));
    let output = apk(built.keys(), &["--install", "--out", &out])
        .env("PATH", std::env::join_paths(path).expect("a path"))
        .output()
        .expect("it starts");
    let asked = std::fs::read_to_string(place.join("asked")).unwrap_or_default();
    (
        text(&output),
        output.status.success(),
        asked
            .lines()
            .map(|line| line.replace(&out, "FILE"))
            .collect(),
    )
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn the_one_headset_gets_it_and_the_app_is_started() {
    let Some(built) = built() else { return };
    let (said, well, asked) = install(built, "one", "2G0YC1ZF\\tdevice", "Success");
    assert!(well, "{said}");
    assert_eq!(
        asked,
        [
            "devices",
            "-s 2G0YC1ZF install -r FILE",
            "-s 2G0YC1ZF shell am start -n org.mon3tr.quest/android.app.NativeActivity",
        ],
        "{said}"
    );
    assert!(said.contains("2G0YC1ZF"), "{said}");
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn without_a_headset_or_with_two_nothing_is_installed_and_the_error_says_what_to_do() {
    let Some(built) = built() else { return };
    for (name, devices, word) in [
        ("none", "", "developer mode"),
        ("two", "A\\tdevice\\nB\\tdevice", "ANDROID_SERIAL"),
        ("locked", "A\\tunauthorized", "allow USB debugging"),
    ] {
        let (said, well, asked) = install(built, name, devices, "Success");
        assert!(!well, "{name}: {said}");
        assert!(said.contains("error: ") && said.contains(word), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        assert_eq!(asked, ["devices"], "{name}");
        let package = built.place(name).join("app.apk");
        assert!(package.is_file(), "the package is there all the same");
    }
}

#[test]
#[ignore = "builds the headset's library: ./run rehearse-android runs it"]
fn a_headset_that_has_it_from_another_key_is_told_how_to_take_this_one() {
    let Some(built) = built() else { return };
    let refusal =
        "adb: failed to install: Failure [INSTALL_FAILED_UPDATE_INCOMPATIBLE: Existing package]";
    let (said, well, asked) = install(built, "other-key", "A\\tdevice", refusal);
    assert!(!well, "{said}");
    assert!(said.contains("adb uninstall org.mon3tr.quest"), "{said}");
    assert_eq!(asked, ["devices", "-s A install -r FILE"]);
}
