//! Packages of a stand-in library, and key stores, as Android's own programs and Java make and see them.

use super::key_store::Key;
use super::pack::Contents;
use super::tools::{Tools, printed, run};
use super::{APPLICATION, repository};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

const PASSWORD: &str = "correct horse";
/// What keytool wants to make a key on P-256.
const EC: [&str; 3] = ["EC", "-groupname", "secp256r1"];
const RSA: [&str; 3] = ["RSA", "-keysize", "2048"];

/// What they need; nothing, after a line that says so, where it is missing. On CI that is a failure.
fn tools() -> Option<(Tools, TempDir)> {
    if std::env::var_os("MON3TR_ANDROID_TOOLS").is_none() {
        let why = "there is no MON3TR_ANDROID_TOOLS (./run test sets it)";
        let on_ci = std::env::var("CI").as_deref() == Ok("true");
        assert!(!on_ci, "{why}, and CI must have it");
        println!("skipped: {why}");
        return None;
    }
    let repo = repository().expect("the repository");
    let tools = Tools::find(&repo).unwrap_or_else(|error| panic!("{error:#}"));
    Some((tools, TempDir::new().expect("a folder")))
}

/// What one of Android's programs says.
fn said(program: &str, arguments: &[&str], package: &Path) -> Output {
    let folder = PathBuf::from(std::env::var_os("MON3TR_ANDROID_TOOLS").expect("it was there"));
    let mut command = Command::new(folder.join(program));
    run(command.args(arguments).arg(package)).expect("it starts")
}

/// What `apksigner verify` says of a package for Android from 7.0 on, which reads the second scheme.
fn verified(package: &Path) -> String {
    let arguments = ["verify", "-v", "--print-certs", "--min-sdk-version", "24"];
    let output = said("apksigner", &arguments, package);
    assert!(output.status.success(), "{}", printed(&output));
    printed(&output)
}

/// Makes a key in the key store `file`.
fn make_key(tools: &Tools, file: &Path, format: &str, alias: &str, algorithm: &[&str]) {
    let mut keytool = tools.keytool(PASSWORD);
    keytool.args(["-genkeypair", "-storetype", format, "-keystore"]);
    keytool
        .arg(file)
        .args(["-alias", alias, "-dname", "CN=Test"]);
    let output = run(keytool.arg("-keyalg").args(algorithm)).expect("it starts");
    assert!(output.status.success(), "{}", printed(&output));
}

/// Packs the app's manifest and resources with a stand-in for its library.
fn pack(tools: &Tools, key: &Key, package: &Path) -> anyhow::Result<u64> {
    let repo = repository()?;
    let contents = Contents {
        manifest: fs::read_to_string(repo.join("android/AndroidManifest.xml"))?,
        resources: &repo.join("android/res"),
        debuggable: false,
        licences: vec![("second.txt", b"second"), ("first.txt", b"first")],
        libraries: vec![("libsecond.so", &[1; 5000]), ("libmain.so", &[2; 70_001])],
    };
    contents.pack(tools, key, package)
}

#[test]
fn every_kind_of_key_signs_by_both_schemes_and_its_certificate_is_the_reported_one() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let path = |name: &str| folder.path().join(name);
    make_key(&tools, &path("rsa.p12"), "PKCS12", "upload", &RSA);
    make_key(&tools, &path("ec.jks"), "JKS", "Upload", &EC);
    let keys = [
        Key::debug(&tools, &path("debug.p12")),
        Key::read(&tools, &path("rsa.p12"), PASSWORD, None),
        Key::read(&tools, &path("ec.jks"), PASSWORD, Some("uPload")),
    ];
    for (key, algorithm) in keys.into_iter().zip(["EC", "RSA", "EC"]) {
        let key = key.unwrap_or_else(|error| panic!("{error:#}"));
        let package = path("test.apk");
        let bytes = pack(&tools, &key, &package).unwrap_or_else(|error| panic!("{error:#}"));
        assert_eq!(bytes, fs::metadata(&package).expect("the package").len());
        let said = verified(&package);
        for line in [
            "(JAR signing): false",
            "(APK Signature Scheme v2): true",
            "(APK Signature Scheme v3): true",
            &format!("key algorithm: {algorithm}"),
            &format!("certificate SHA-256 digest: {}", key.certificate_sha256),
        ] {
            assert!(said.contains(line), "{line} in:\n{said}");
        }
        assert!(!said.contains("WARNING"), "{said}");
    }
}

#[test]
fn equal_contents_give_equal_files_with_a_key_whose_signatures_hold_nothing_random() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let path = |name: &str| folder.path().join(name);
    make_key(&tools, &path("rsa.p12"), "PKCS12", "upload", &RSA);
    let key = Key::read(&tools, &path("rsa.p12"), PASSWORD, None).expect("a key");
    let [one, two] = ["one.apk", "two.apk"].map(|name| {
        pack(&tools, &key, &path(name)).expect("a package");
        fs::read(path(name)).expect("the package")
    });
    assert!(one == two, "they differ");
}

#[test]
fn python_and_zipalign_find_every_member_whole_and_where_it_must_lie() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let package = folder.path().join("test.apk");
    let key = Key::debug(&tools, &folder.path().join("debug.p12")).expect("a key");
    pack(&tools, &key, &package).expect("a package");
    // This release knows pages of 4096 bytes only.
    let output = said("zipalign", &["-c", "-p", "4"], &package);
    let text = printed(&output);
    assert!(
        output.status.success() && !text.contains("WARNING"),
        "{text}"
    );
    let script = r#"
import struct, sys, zipfile
data = open(sys.argv[1], "rb").read()
archive = zipfile.ZipFile(sys.argv[1])
assert archive.testzip() is None
for one in archive.infolist():
    name, extra = struct.unpack_from("<HH", data, one.header_offset + 26)
    print(one.filename, one.compress_type, one.header_offset + 30 + name + extra, one.date_time[0], one.flag_bits & 8)
"#;
    let mut python = Command::new("python3");
    let listed = run(python.args(["-c", script]).arg(&package)).expect("it starts");
    let listed = printed(&listed);
    let mut names = Vec::new();
    for line in listed.lines() {
        let fields: Vec<&str> = line.split(' ').collect();
        let number = |index: usize| fields[index].parse::<u64>().expect("a number");
        let (name, stored, start) = (fields[0], number(1) == 0, number(2));
        let wanted = match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
            "so" => Some(16 * 1024),
            "arsc" | "png" => Some(4),
            _ => None,
        };
        assert_eq!(stored, wanted.is_some(), "{line}");
        assert!(start.is_multiple_of(wanted.unwrap_or(1)), "{line}");
        assert_eq!(number(3), 1980, "no time of building: {line}");
        assert_eq!(number(4), 0, "sizes stand before the data: {line}");
        names.push(name);
    }
    for name in [
        "AndroidManifest.xml",
        "resources.arsc",
        "assets/licences/first.txt",
        "assets/licences/second.txt",
        "lib/arm64-v8a/libmain.so",
        "lib/arm64-v8a/libsecond.so",
    ] {
        assert!(names.contains(&name), "{name} in:\n{listed}");
    }
    let badging = printed(&said("aapt2", &["dump", "badging"], &package));
    let package = format!("package: name='{APPLICATION}' versionCode='100'");
    for line in [package.as_str(), "application-label:'Mon3tr'"] {
        assert!(badging.contains(line), "{line} in:\n{badging}");
    }
    for density in [160, 240, 320, 480, 640] {
        let icon = format!("application-icon-{density}:'res/mipmap-");
        assert!(badging.contains(&icon), "{icon} in:\n{badging}");
    }
    assert!(!badging.contains("debuggable"), "{badging}");
}

#[test]
fn what_cannot_be_packaged_is_named_and_leaves_what_was_there() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let key = Key::debug(&tools, &folder.path().join("debug.p12")).expect("a key");
    let package = folder.path().join("test.apk");
    fs::write(&package, "what was there").expect("a file");
    let resources = repository().expect("the repository").join("android/res");
    let nowhere = folder.path().join("no-res");
    for (manifest, resources, words) in [
        ("<manifest", &resources, "AndroidManifest.xml:1: "),
        (
            "<manifest package='a.b'><application android:label='x'/></manifest>",
            &resources,
            "AndroidManifest.xml:1: ",
        ),
        ("<manifest package='a.b'/>", &nowhere, "no-res"),
    ] {
        let contents = Contents {
            manifest: manifest.to_owned(),
            resources,
            debuggable: false,
            licences: vec![("second.txt", b"second"), ("first.txt", b"first")],
            libraries: Vec::new(),
        };
        let error = contents.pack(&tools, &key, &package).expect_err(words);
        let error = format!("{error:#}");
        assert!(error.contains(words), "{error} should speak of {words}");
    }
    let old = fs::read_to_string(&package).expect("it is there");
    assert_eq!(old, "what was there");
    let left = fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(left, 2, "the key and what was there");
}

#[test]
fn a_debug_key_is_made_once_and_for_its_owner_only() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let path = folder.path().join("debug.p12");
    let first = Key::debug(&tools, &path).expect("a key");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = fs::metadata(&path).expect("its file").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }
    let second = Key::debug(&tools, &path).expect("the same key");
    assert_eq!(first.certificate_sha256, second.certificate_sha256);
    fs::write(&path, "not a key").expect("a file");
    let error = Key::debug(&tools, &path).map(drop).expect_err("no key");
    assert!(error.to_string().contains("debug.p12"), "{error}");
}

#[test]
fn what_is_wrong_with_a_key_store_is_said() {
    let Some((tools, folder)) = tools() else {
        return;
    };
    let path = |name: &str| folder.path().join(name);
    make_key(&tools, &path("one.p12"), "PKCS12", "first", &EC);
    fs::copy(path("one.p12"), path("two.p12")).expect("a copy");
    make_key(&tools, &path("two.p12"), "PKCS12", "second", &EC);
    fs::write(path("text.p12"), "not a key store").expect("a file");
    let read = |name: &str, password: &str, alias| Key::read(&tools, &path(name), password, alias);
    let first = read("two.p12", PASSWORD, Some("First")).expect("a key");
    let only = read("one.p12", PASSWORD, None).expect("a key");
    assert_eq!(first.certificate_sha256, only.certificate_sha256);
    for (name, password, alias, words) in [
        ("one.p12", "wrong one", None, "the password is wrong"),
        ("one.p12", "", None, "the password is wrong"),
        (
            "one.p12",
            PASSWORD,
            Some("third"),
            "holds no key called \"third\", but first",
        ),
        (
            "two.p12",
            PASSWORD,
            None,
            "the alias of one has to be given: first, second",
        ),
        ("text.p12", PASSWORD, None, "cannot be read as a key store"),
    ] {
        let error = read(name, password, alias).map(drop).expect_err(words);
        let error = format!("{error:#}");
        assert!(error.contains(words), "{error} should speak of {words}");
        assert!(error.contains(name) && !error.contains(PASSWORD), "{error}");
    }
}
