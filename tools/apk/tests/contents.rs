//! What is in a package, by Android's own programs and Python's zipfile.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use apk::{Asset, Contents, Library, Report, Signer, Source};
use common::{contents, text, tools, write};

/// A package of these contents in a folder of its own.
fn packaged(contents: &Contents) -> (tempfile::TempDir, PathBuf, Report) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("test.apk");
    let signer = Signer::debug(&folder.path().join("debug.pem")).expect("a debug key");
    let report = write(contents, &signer, &path);
    (folder, path, report)
}

#[test]
fn aapt_reads_from_binary_xml_what_androids_packager_makes_of_the_same_texts() {
    let Some(tools) = tools() else { return };
    let (_folder, path, _) = packaged(&Contents {
        metadata: Vec::new(),
        ..contents()
    });
    let members = [
        "AndroidManifest.xml",
        "res/mipmap-anydpi-v26/icon.xml",
        "res/drawable/icon_foreground.xml",
    ];
    let ours: String = members
        .into_iter()
        .map(|member| tools.dump(&["xmltree"], &path, Some(member)))
        .collect();
    assert_eq!(ours, include_str!("expected/xmltree.txt"));
}

#[test]
fn aapt_reads_from_the_table_what_androids_packager_makes_of_the_same_folder() {
    let Some(tools) = tools() else { return };
    let (_folder, path, _) = packaged(&contents());
    // Where a string stands in its pool is each packager's own choice.
    let without_places = |text: &str| -> String {
        text.lines()
            .map(|line| {
                if line.contains(": t=0x03 d=") {
                    line.split(" d=").next().unwrap_or_default()
                } else {
                    line
                }
            })
            .collect::<Vec<_>>()
            .join("\n")
    };
    assert_eq!(
        without_places(&tools.dump(&["--values", "resources"], &path, None)),
        without_places(include_str!("expected/resources.txt"))
    );
}

#[test]
fn aapt2_reads_the_same_from_our_package_as_from_its_own() {
    let Some(tools) = tools() else { return };
    let (_folder, path, _) = packaged(&contents());
    let resources = tools.dump2(&["resources"], &path);
    assert_eq!(resources, include_str!("expected/resources-aapt2.txt"));
    let badging = tools.dump2(&["badging"], &path);
    for line in [
        "uses-native-library-not-required:'libcdsprpc.so'",
        "application-label-de:'Beispiel für Brillen'",
        "native-code: 'arm64-v8a'",
    ] {
        assert!(
            badging.lines().any(|one| one == line),
            "{line} is missing in\n{badging}"
        );
    }
}

#[test]
fn an_empty_resource_folder_gives_an_empty_table() {
    let Some(tools) = tools() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let manifest = "<manifest xmlns:android='http://schemas.android.com/apk/res/android' package='a.b'>
        <uses-sdk android:minSdkVersion='29' android:targetSdkVersion='32'/><application android:label='x'/></manifest>";
    let resources = Some(folder.path().to_owned());
    let empty = Contents {
        manifest: manifest.into(),
        resources,
        ..Contents::default()
    };
    let (_folder, path, _) = packaged(&empty);
    let badging = tools.dump(&["badging"], &path, None);
    assert!(badging.contains("package: name='a.b'"), "{badging}");
    let table = tools.dump2(&["resources"], &path);
    assert_eq!(
        table,
        "Binary APK
"
    );
}

#[test]
fn aapt_tells_users_what_the_package_is() {
    let Some(tools) = tools() else { return };
    let (_folder, path, report) = packaged(&contents());
    assert_eq!(report.package, "org.example.headset");
    let badging = tools.dump(&["badging"], &path, None);
    for line in [
        "package: name='org.example.headset' versionCode='17' versionName='1.2.3'",
        "install-location:'auto'",
        "sdkVersion:'29'",
        "targetSdkVersion:'32'",
        "uses-permission: name='android.permission.INTERNET'",
        "uses-permission: name='android.permission.WRITE_EXTERNAL_STORAGE' maxSdkVersion='29'",
        "application-label:'Example for headsets'",
        "application-label-de:'Beispiel für Brillen'",
        "application-icon-160:'res/mipmap-anydpi-v26/icon.xml'",
        "launchable-activity: name='android.app.NativeActivity'  label='Example for headsets' icon=''",
        "  uses-feature: name='android.hardware.vr.headtracking' version='1'",
        "  uses-feature-not-required: name='com.oculus.feature.PASSTHROUGH'",
        "  uses-gl-es: '0x30001'",
        "densities: '160' '480' '65534'",
        "native-code: 'arm64-v8a'",
    ] {
        assert!(
            badging.lines().any(|one| one == line),
            "{line} is missing in\n{badging}"
        );
    }
    let tree = tools.dump(&["xmltree"], &path, Some("AndroidManifest.xml"));
    let built = "      E: meta-data (line=28)\n        A: android:name(0x01010003)=\"org.example.built\" (Raw: \"org.example.built\")\n        A: android:value(0x01010024)=\"without <an> NDK\"";
    assert!(
        tree.contains(built),
        "the metadata stand in <application>: {tree}"
    );
}

#[test]
fn strings_of_every_length_and_script_reach_the_table() {
    let Some(tools) = tools() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let values = folder.path().join("values");
    fs::create_dir(&values).expect("a folder");
    // With none too long or beyond 16 bits the pool is in UTF-8, else in UTF-16.
    let short: Vec<String> = [1, 126, 127, 128, 129, 255, 256, 10_922]
        .map(|length| "€".repeat(length))
        .into();
    let long: Vec<String> = [32_766, 32_767, 32_768, 65_536]
        .map(|length| "x".repeat(length))
        .into();
    let high = vec!["𝄞 clef 😀".to_owned(), "ä".to_owned()];
    for (strings, stored) in [
        (short, "(string8)"),
        (long, "(string16)"),
        (high, "(string16)"),
    ] {
        let lines: String = strings
            .iter()
            .enumerate()
            .map(|(index, text)| format!("<string name=\"s{index:02}\">{text}</string>\n"))
            .collect();
        fs::write(
            values.join("strings.xml"),
            format!("<resources>{lines}</resources>"),
        )
        .expect("a file");
        let manifest = contents()
            .manifest
            .replace("@string/app_name", "x")
            .replace("@mipmap/icon", "@string/s00")
            .replace("@color/background", "@string/s00");
        let (_folder, path, _) = packaged(&Contents {
            manifest,
            resources: Some(folder.path().into()),
            ..Contents::default()
        });
        let dump = tools.dump(&["--values", "resources"], &path, None);
        for text in strings {
            let line = format!("          {stored} \"{text}\"");
            assert!(
                dump.lines().any(|one| one == line),
                "{} bytes of {:?} are missing",
                text.len(),
                text.chars().next()
            );
        }
    }
}

#[test]
fn zipalign_and_python_find_every_member_whole_and_where_it_must_lie() {
    let (_folder, path, report) = packaged(&contents());
    // Android's own check; before version 35 it knew pages of 4096 bytes only.
    if let Some(tools) = tools() {
        let checked = tools.zipalign(&path);
        assert!(
            checked.status.success() && text(&checked).contains("Verification successful"),
            "{}",
            text(&checked)
        );
    }
    let script = r#"
import struct, sys, zipfile
data = open(sys.argv[1], "rb").read()
archive = zipfile.ZipFile(sys.argv[1])
assert archive.testzip() is None
for one in archive.infolist():
    name, extra = struct.unpack_from("<HH", data, one.header_offset + 26)
    print(one.filename, one.compress_type, one.header_offset + 30 + name + extra, one.file_size, one.date_time[0], one.flag_bits)
"#;
    let output = Command::new("python3")
        .args(["-c", script])
        .arg(&path)
        .output()
        .expect("python3 runs");
    assert!(output.status.success(), "{}", text(&output));
    let listed = text(&output);
    let mut names = Vec::new();
    for (line, member) in listed.lines().zip(&report.members) {
        let fields: Vec<&str> = line.split(' ').collect();
        let number = |index: usize| fields[index].parse::<u64>().expect("a number");
        let (name, stored, offset) = (fields[0], number(1) == 0, number(2));
        assert_eq!(
            (name, number(3)),
            (member.name.as_str(), member.size),
            "the report tells the members"
        );
        let wanted = match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
            "so" => Some(16 * 1024),
            "arsc" | "png" | "bin" => Some(4),
            _ => None,
        };
        assert_eq!(stored, wanted.is_some(), "{line}");
        assert!(offset.is_multiple_of(wanted.unwrap_or(1)), "{line}");
        assert_eq!(number(4), 1980, "no time of building: {line}");
        assert_eq!(
            number(5),
            0,
            "Android's reader wants sizes before the data, and names here are ASCII: {line}"
        );
        names.push(name.to_owned());
    }
    assert_eq!(
        names,
        [
            "AndroidManifest.xml",
            "resources.arsc",
            "res/drawable/icon_foreground.xml",
            "res/mipmap-anydpi-v26/icon.xml",
            "res/mipmap-mdpi/icon.png",
            "res/mipmap-xxhdpi/icon.png",
            "assets/a.bin",
            "assets/deep/b.txt",
            "lib/arm64-v8a/libmain.so",
            "lib/arm64-v8a/libsecond.so",
        ]
    );
    assert_eq!(report.size, fs::metadata(&path).expect("the package").len());
}

#[test]
fn what_cannot_be_packaged_is_named_and_leaves_what_was_there() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("test.apk");
    fs::write(&path, "what was there").expect("a file");
    let signer = Signer::debug(&folder.path().join("debug.pem")).expect("a debug key");
    let library = |name: &str| Library {
        name: name.into(),
        source: Source::Bytes(vec![1]),
    };
    let missing = Library {
        name: "liba.so".into(),
        source: Source::File(folder.path().join("no.so")),
    };
    let asset = |name: &str| Asset {
        name: name.into(),
        source: Source::Bytes(vec![1]),
        compressed: true,
    };
    let good = contents();
    for (contents, why) in [
        (
            Contents {
                libraries: vec![missing],
                ..good.clone()
            },
            "no.so",
        ),
        (
            Contents {
                libraries: vec![library("main.so")],
                ..good.clone()
            },
            "main.so cannot be packaged: Android finds only",
        ),
        (
            Contents {
                libraries: vec![library("lib/a.so")],
                ..good.clone()
            },
            "lib/a.so cannot be packaged",
        ),
        (
            Contents {
                libraries: vec![library("liba.so"), library("liba.so")],
                ..good.clone()
            },
            "there are two of this name",
        ),
        (
            Contents {
                assets: vec![asset("../a")],
                ..good.clone()
            },
            "assets/../a cannot be packaged",
        ),
        (
            Contents {
                resources: Some(folder.path().join("no-res")),
                ..good.clone()
            },
            "no-res",
        ),
        (
            Contents {
                resources: None,
                ..good.clone()
            },
            "AndroidManifest.xml:29: android:label of <application>: there is no resource @string/app_name",
        ),
        (
            Contents {
                metadata: vec![(String::new(), "x".into())],
                ..good.clone()
            },
            "metadata",
        ),
        (
            Contents {
                manifest: "<manifest".into(),
                ..good.clone()
            },
            "AndroidManifest.xml:1: ",
        ),
    ] {
        let error = apk::write(&contents, &signer, &path).expect_err(why);
        assert!(
            error.to_string().contains(why),
            "{error} should speak of {why}"
        );
    }
    assert_eq!(fs::read(&path).expect("it is there"), b"what was there");
    let left = fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(
        left, 2,
        "nothing is left besides the key and what was there"
    );
    let nowhere = folder.path().join("no-folder/test.apk");
    let error = apk::write(&good, &signer, &nowhere)
        .expect_err("there is no such folder")
        .to_string();
    assert!(error.contains("no-folder"), "{error}");
}
