//! `android/profile.sh` with a made-up `adb`, which answers as a headset's would and records its arguments.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

const PACKAGE: &str = "org.example.quest";

/// Answers from files in the folder `$HEADSET`.
const ADB: &str = r#"#!/bin/bash
echo "$*" >>"$HEADSET/calls"
if [ "$1" = -s ]; then shift 2; fi
case $1 in
start-server) ;;
devices) printf 'List of devices attached\n'; cat "$HEADSET/devices"; printf '\n' ;;
install) cat "$HEADSET/install"; ! grep -q Failure "$HEADSET/install" ;;
logcat) if [ "$2" = -d ]; then cat "$HEADSET/log"; fi ;;
pull) cp "$HEADSET/files/${2##*/}" "$3" ;;
shell)
	case $2 in
	"pm path"*) cat "$HEADSET/installed" 2>/dev/null ;;
	"am force-stop"*) case $2 in *"rm -f"*) rm -f "$HEADSET/started" ;; esac ;;
	"am start"*) cat "$HEADSET/start"; touch "$HEADSET/started" ;;
	pidof*) if [ ! -e "$HEADSET/crashed" ]; then printf '4242\r\n'; fi ;;
	cat*)
		# Not the first time that it is asked.
		if [ -e "$HEADSET/started" ] && [ -e "$HEADSET/asked" ]; then cat "$HEADSET/finished" 2>/dev/null; fi
		touch "$HEADSET/asked"
		;;
	esac
	;;
esac
"#;

/// A copy of the script beside a manifest, and a headset that works.
struct Headset(TempDir);

/// The result of a run of the script.
struct Run {
    succeeded: bool,
    out: String,
    err: String,
    calls: String,
}

impl Headset {
    fn new() -> Self {
        let new = Self(tempfile::tempdir().expect("a temporary folder"));
        let android = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../android");
        for file in ["profile.sh", "headset.sh"] {
            let script = fs::read_to_string(android.join(file)).expect("the script");
            new.write(&format!("repo/android/{file}"), &script);
        }
        let manifest = format!(
            "<?xml version=\"1.0\"?>\n<!-- package=\"not.this\" -->\n<manifest xmlns:android=\"http://schemas.android.com/apk/res/android\"\n    package=\"{PACKAGE}\"\n    android:versionCode=\"1\">\n</manifest>\n"
        );
        new.write("repo/android/AndroidManifest.xml", &manifest);
        new.write("some.apk", "an APK");
        new.write("repo/.cache/avatars/demo-60000-v3.m3a", "an avatar");
        new.write("bin/adb", ADB);
        fs::set_permissions(new.path("bin/adb"), fs::Permissions::from_mode(0o755))
            .expect("it can be made a program");
        for (file, text) in [
            ("devices", "2G0YC5ZF\tdevice\n"),
            ("install", "Performing Streamed Install\nSuccess\n"),
            ("start", "Starting: Intent { cmp=quest }\n"),
            (
                "log",
                "I mon3tr  : drawing\nI other: noise\nE mon3tr  : the GPU is gone\n",
            ),
            ("finished", "ok\r\n"),
            ("files/profile.txt", "the table\n"),
            ("files/profile.html", "<!doctype html>\n"),
            ("files/trace.json", "{}\n"),
            ("files/profile.json", "{}\n"),
        ] {
            new.write(&format!("headset/{file}"), text);
        }
        new
    }

    fn path(&self, file: &str) -> PathBuf {
        self.0.path().join(file)
    }

    fn write(&self, file: &str, text: &str) {
        let file = self.path(file);
        fs::create_dir_all(file.parent().expect("it has a folder")).expect("a folder");
        fs::write(file, text).expect("a file");
    }

    /// Runs the script with `arguments`, of which `APK` and `OUT` are this headset's.
    fn run(&self, arguments: &[&str]) -> Run {
        let path = std::env::var("PATH").unwrap_or_default();
        let arguments = arguments.iter().map(|one| match *one {
            "APK" => self.path("some.apk").display().to_string(),
            "OUT" => self.path("out").display().to_string(),
            other => other.to_owned(),
        });
        let output = Command::new("bash")
            .arg(self.path("repo/android/profile.sh"))
            .args(arguments)
            .env("PATH", format!("{}:{path}", self.path("bin").display()))
            .env("HEADSET", self.path("headset"))
            .env_remove("MON3TR_CACHE")
            .env("MON3TR_PROFILE_POLL", "0.01")
            .env("MON3TR_PROFILE_PATIENCE", "0")
            .output()
            .expect("bash runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Run {
            succeeded: output.status.success(),
            out: text(&output.stdout),
            err: text(&output.stderr),
            calls: fs::read_to_string(self.path("headset/calls")).unwrap_or_default(),
        }
    }
}

/// Asserts that `run` failed and said `said`.
fn assert_fails(run: &Run, said: &str) {
    assert!(!run.succeeded, "it should fail:\n{}{}", run.out, run.err);
    assert!(run.err.contains(said), "{said:?} is not in:\n{}", run.err);
}

#[test]
fn a_profile_is_installed_run_awaited_fetched_and_printed() {
    let headset = Headset::new();
    let run = headset.run(&["--seconds", "30", "--out", "OUT", "APK"]);
    assert!(run.succeeded, "{}{}", run.out, run.err);
    assert!(run.out.contains("the table"), "{}", run.out);
    for file in ["profile.txt", "profile.html", "trace.json", "profile.json"] {
        assert!(headset.path("out").join(file).is_file(), "{file} is here");
    }
    let wanted = format!("shell am start -n {PACKAGE}/android.app.NativeActivity --es profile 30");
    let at = |what: &str| {
        let at = run.calls.find(what);
        at.unwrap_or_else(|| panic!("{what} is not in\n{}", run.calls))
    };
    let old = format!("rm -f /sdcard/Android/data/{PACKAGE}/files/profile/finished");
    let avatar = headset.path("repo/.cache/avatars/demo-60000-v3.m3a");
    let pushed = format!(
        "push {} /sdcard/Android/data/{PACKAGE}/files/avatar.m3a",
        avatar.display()
    );
    let pulled = format!("pull /sdcard/Android/data/{PACKAGE}/files/profile/profile.json");
    assert!(
        at("install -r") < at(&old)
            && at(&old) < at(&pushed)
            && at(&pushed) < at(&wanted)
            && at(&wanted) < at(&pulled),
        "in this order:\n{}",
        run.calls
    );
}

#[test]
fn a_placement_is_handed_to_the_app() {
    let headset = Headset::new();
    let arguments = ["--placement", "cpu,npu=nnapi", "--out", "OUT", "APK"];
    let run = headset.run(&arguments);
    assert!(run.succeeded, "{}{}", run.out, run.err);
    let wanted = "--es profile 60 --es placement cpu,npu=nnapi\n";
    assert!(run.calls.contains(wanted), "{}", run.calls);
}

#[test]
fn a_missing_avatar_is_reported_before_anything_is_installed() {
    let headset = Headset::new();
    let run = headset.run(&["--avatar", "none.m3a", "--out", "OUT", "APK"]);
    assert_fails(&run, "there is no avatar none.m3a");
    assert!(!run.calls.contains("install"), "{}", run.calls);
}

#[test]
fn a_crash_of_the_app_is_reported_with_its_last_log_lines() {
    let headset = Headset::new();
    headset.write("headset/crashed", "");
    headset.write("headset/finished", "");
    let run = headset.run(&["--out", "OUT", "APK"]);
    assert_fails(&run, "ended before it had measured");
    assert!(run.err.contains("the GPU is gone"), "{}", run.err);
    assert!(
        !run.err.contains("noise"),
        "others' lines are left out: {}",
        run.err
    );
    assert!(!headset.path("out").exists(), "nothing was fetched");
}

#[test]
fn the_apps_reason_for_a_failed_measurement_is_reported() {
    let headset = Headset::new();
    headset.write("headset/finished", "failed: no OpenXR runtime\n");
    let run = headset.run(&["--out", "OUT", "APK"]);
    assert_fails(&run, "the app could not measure: no OpenXR runtime");
}

#[test]
fn the_wait_for_an_app_that_never_ends_is_bounded() {
    let headset = Headset::new();
    headset.write("headset/finished", "");
    let run = headset.run(&["--seconds", "5", "--out", "OUT", "APK"]);
    assert_fails(&run, "was the headset worn?");
}

#[test]
fn no_headset_several_and_one_that_does_not_trust_are_distinguished() {
    for (devices, arguments, said) in [
        ("", &["APK"][..], "adb sees no headset"),
        (
            "A1\tdevice\nB2\tdevice\n",
            &["APK"],
            "several devices (A1 B2)",
        ),
        (
            "A1\tunauthorized\n",
            &["APK"],
            "A1 does not trust this computer",
        ),
        ("A1\toffline\n", &["APK"], "A1 is offline"),
        (
            "A1\tdevice\n",
            &["--device", "C3", "APK"],
            "no device C3, but A1",
        ),
    ] {
        let headset = Headset::new();
        headset.write("headset/devices", devices);
        let run = headset.run(arguments);
        assert_fails(&run, said);
        assert!(
            !run.calls.contains("install"),
            "nothing is done: {}",
            run.calls
        );
    }
}

#[test]
fn of_several_headsets_the_one_that_is_named_is_used() {
    let headset = Headset::new();
    headset.write(
        "headset/devices",
        "A1\tdevice\nB2\tdevice product:q model:Quest_3\n",
    );
    let run = headset.run(&["--device", "B2", "--out", "OUT", "APK"]);
    assert!(run.succeeded, "{}{}", run.out, run.err);
    assert!(!run.calls.contains("-s A1"), "{}", run.calls);
}

#[test]
fn a_package_of_another_key_and_other_refusals_of_an_install_are_reported() {
    for (answer, said) in [
        (
            "Failure [INSTALL_FAILED_UPDATE_INCOMPATIBLE: signatures do not match]\n",
            "signed with another key",
        ),
        (
            "Failure [INSTALL_FAILED_INSUFFICIENT_STORAGE]\n",
            "INSUFFICIENT_STORAGE",
        ),
    ] {
        let headset = Headset::new();
        headset.write("headset/install", answer);
        assert_fails(&headset.run(&["APK"]), said);
    }
}

#[test]
fn the_installed_app_is_measured_only_if_there_is_one() {
    let headset = Headset::new();
    let arguments = ["--no-install", "--out", "OUT"];
    assert_fails(&headset.run(&arguments), "is not installed");
    headset.write("headset/installed", "package:/data/app/base.apk\n");
    let run = headset.run(&arguments);
    assert!(run.succeeded, "{}{}", run.out, run.err);
    assert!(!run.calls.contains("install -r"), "{}", run.calls);
}

#[test]
fn a_missing_activity_is_reported() {
    let headset = Headset::new();
    headset.write(
        "headset/start",
        "Starting: Intent\nError type 3\nError: Activity class does not exist.\n",
    );
    assert_fails(
        &headset.run(&["APK"]),
        "the app does not start: Error type 3",
    );
}

#[test]
fn wrong_arguments_are_refused_before_a_headset_is_asked() {
    let headset = Headset::new();
    for (arguments, said) in [
        (&["--seconds", "0", "APK"][..], "whole number of 5 to 3600"),
        (
            &["--seconds", "5; reboot", "APK"],
            "whole number of 5 to 3600",
        ),
        (&["--seconds", "08", "APK"], "whole number of 5 to 3600"),
        (&["--seconds"], "--seconds needs a value"),
        (&["--fast", "APK"], "no option --fast"),
        (&["APK", "APK"], "one APK is enough"),
        (&["none.apk"], "there is no none.apk"),
        (&[], "mon3tr-quest3.apk: build it"),
    ] {
        let run = headset.run(arguments);
        assert_fails(&run, said);
        assert_eq!(run.calls, "", "{arguments:?}");
    }
    let help = headset.run(&["--help"]);
    assert!(
        help.succeeded && help.out.contains("Usage:"),
        "{}",
        help.out
    );
}

#[test]
fn without_adb_the_error_says_where_to_get_it() {
    let headset = Headset::new();
    // Only what the script needs before it looks for adb.
    let tools = headset.path("tools");
    fs::create_dir(&tools).expect("a folder");
    let path = std::env::var_os("PATH").unwrap_or_default();
    for tool in ["bash", "cat", "dirname", "head", "readlink", "sed"] {
        let found = std::env::split_paths(&path).map(|folder| folder.join(tool));
        let mut found = found;
        let found = found.find(|file| file.is_file()).expect("a Unix tool");
        std::os::unix::fs::symlink(found, tools.join(tool)).expect("a link");
    }
    let output = Command::new("bash")
        .arg(headset.path("repo/android/profile.sh"))
        .arg(headset.path("some.apk"))
        .env("PATH", &tools)
        .env_remove("MON3TR_CACHE")
        .output()
        .expect("bash runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && said.contains("adb is missing"),
        "{said}"
    );
}
