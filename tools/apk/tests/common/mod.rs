//! What the tests of whole packages share: Android's own programs, and a package to try them on.

#![allow(dead_code, reason = "each test binary uses what it needs")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use apk::{Asset, Contents, Library, Report, Signer, Source};

/// Android's own programs, and Java.
pub(crate) struct Tools {
    folder: PathBuf,
    java: PathBuf,
}

/// Where they are; nothing, after a line that says so, where they are missing. On CI that is a failure.
pub(crate) fn tools() -> Option<Tools> {
    let found = std::env::var_os("MON3TR_ANDROID_TOOLS").map(|folder| Tools {
        folder: folder.into(),
        java: std::env::var_os("MON3TR_JAVA")
            .unwrap_or("java".into())
            .into(),
    });
    if found.is_none() {
        let why = "there is no MON3TR_ANDROID_TOOLS (./run test sets it)";
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "{why}, and CI must have it"
        );
        println!("skipped: {why}");
    }
    found
}

impl Tools {
    /// What `aapt dump WHAT FILE [MEMBER]` prints.
    pub(crate) fn dump(&self, what: &[&str], file: &Path, member: Option<&str>) -> String {
        self.dump_by("aapt", what, file, member)
    }

    /// The same by `aapt2`, whose readers are others, and stricter.
    pub(crate) fn dump2(&self, what: &[&str], file: &Path) -> String {
        self.dump_by("aapt2", what, file, None)
    }

    fn dump_by(&self, program: &str, what: &[&str], file: &Path, member: Option<&str>) -> String {
        let mut command = Command::new(self.folder.join(program));
        command.arg("dump").args(what).arg(file).args(member);
        let output = command.output().expect("the program runs");
        let text = String::from_utf8(output.stdout).expect("aapt prints UTF-8");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success() && !errors.to_lowercase().contains("error"),
            "{program} dump {what:?}: {text}{errors}"
        );
        text
    }

    /// What `zipalign` says.
    pub(crate) fn zipalign(&self, file: &Path) -> Output {
        let program = self.folder.join("zipalign");
        Command::new(program)
            .args(["-c", "-p", "-v", "4"])
            .arg(file)
            .output()
            .expect("zipalign runs")
    }

    /// What `apksigner verify` says, for Android from `oldest` on (0: what the manifest says).
    pub(crate) fn verify(&self, file: &Path, oldest: u32) -> Output {
        let oldest = oldest.to_string();
        let mut args = vec!["verify", "--verbose", "--print-certs"];
        if oldest != "0" {
            args.extend(["--min-sdk-version", &oldest]);
        }
        let mut command = Command::new(self.folder.join("apksigner"));
        command
            .args(args)
            .arg(file)
            .env("MON3TR_JAVA", &self.java)
            .output()
            .expect("apksigner runs")
    }

    /// The package is signed as both schemes ask, and Android of any version takes it; what apksigner says.
    pub(crate) fn assert_signed(&self, file: &Path) -> String {
        let mut said = String::new();
        for oldest in [0, 24, 29] {
            let output = self.verify(file, oldest);
            said = text(&output);
            assert!(output.status.success(), "apksigner refuses it: {said}");
            for scheme in [
                "v2 scheme (APK Signature Scheme v2): true",
                "v3 scheme (APK Signature Scheme v3): true",
            ] {
                assert!(
                    said.contains(scheme) || oldest != 24,
                    "signed by {scheme}: {said}"
                );
            }
            assert!(!said.contains("WARNING"), "nothing to warn of: {said}");
        }
        said
    }

    /// A key store as Java makes it.
    pub(crate) fn make_key_store(
        &self,
        file: &Path,
        format: &str,
        alias: &str,
        algorithm: &[&str],
    ) {
        let mut command = Command::new(&self.java);
        command
            .args([
                "-m",
                "java.base/sun.security.tools.keytool.Main",
                "-genkeypair",
                "-keystore",
            ])
            .arg(file);
        command.args([
            "-storetype",
            format,
            "-alias",
            alias,
            "-validity",
            "10000",
            "-dname",
            "CN=Test",
        ]);
        command
            .args(["-storepass", PASSWORD, "-keypass", PASSWORD, "-keyalg"])
            .args(algorithm);
        let output = command.output().expect("java runs");
        assert!(output.status.success(), "keytool: {}", text(&output));
    }
}

pub(crate) const PASSWORD: &str = "correct horse";

/// All that a program printed.
pub(crate) fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

pub(crate) fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixture")
}

/// Bytes that do not deflate, the same every time.
fn noise(length: usize) -> Vec<u8> {
    let mut state = 0x9e37_79b9_u32;
    (0..length)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state.to_le_bytes()[1]
        })
        .collect()
}

/// The fixture's manifest and resources, libraries of which one is several pieces of a digest long, and assets.
pub(crate) fn contents() -> Contents {
    let library = |name: &str, bytes| Library {
        name: name.into(),
        source: Source::Bytes(bytes),
    };
    let asset = |name: &str, bytes: &[u8], compressed| Asset {
        name: name.into(),
        source: Source::Bytes(bytes.to_vec()),
        compressed,
    };
    Contents {
        manifest: fs::read_to_string(fixture().join("AndroidManifest.xml")).expect("the fixture"),
        resources: Some(fixture().join("res")),
        libraries: vec![
            library("libsecond.so", noise(5000)),
            library("libmain.so", noise(2_500_001)),
        ],
        assets: vec![
            asset("deep/b.txt", &b"text ".repeat(1000), true),
            asset("a.bin", b"12345", false),
        ],
        metadata: vec![("org.example.built".into(), "without <an> NDK".into())],
    }
}

/// The contents in a file.
pub(crate) fn write(contents: &Contents, signer: &Signer, path: &Path) -> Report {
    apk::write(contents, signer, path).unwrap_or_else(|error| panic!("{error}"))
}

/// Where the signing block starts and the zip's directory after it, by the zip's end.
pub(crate) fn signing_block(apk: &[u8]) -> std::ops::Range<usize> {
    let end = apk.len() - 22;
    let directory =
        u32::from_le_bytes(apk[end + 16..end + 20].try_into().expect("four bytes")) as usize;
    assert_eq!(
        &apk[directory - 16..directory],
        b"APK Sig Block 42",
        "the block's magic"
    );
    let size = u64::from_le_bytes(
        apk[directory - 24..directory - 16]
            .try_into()
            .expect("eight bytes"),
    );
    directory - usize::try_from(size).expect("a size") - 8..directory
}
