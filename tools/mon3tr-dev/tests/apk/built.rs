//! The package that all tests look at: built once, for the first that asks.

use crate::tools::{apk, output_of, skip, text, variable};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A package, and what the command said of it.
pub(crate) struct Built {
    folder: PathBuf,
    pub(crate) file: PathBuf,
    pub(crate) said: String,
    pub(crate) report: serde_json::Value,
}

/// The package; nothing, after a line that says so, where this machine lacks what it is made from. On CI that is a failure.
pub(crate) fn built() -> Option<&'static Built> {
    static BUILT: OnceLock<Option<Built>> = OnceLock::new();
    let built = BUILT.get_or_init(|| {
        let there = variable("MON3TR_ANDROID_PARTS").is_some() && has_target();
        there.then(Built::new)
    });
    if built.is_none() {
        println!("skipped: there is no package to look at");
    }
    built.as_ref()
}

fn has_target() -> bool {
    let mut rustc = Command::new("rustc");
    rustc.args([
        "--print",
        "target-libdir",
        "--target",
        "aarch64-linux-android",
    ]);
    let found = Path::new(output_of(&mut rustc).trim()).is_dir();
    if !found {
        skip("Rust has no standard library for aarch64-linux-android (./run test gets it)");
    }
    found
}

impl Built {
    fn new() -> Self {
        // It holds several packages and stays: a static is never dropped. So each run replaces the last one's.
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("apk");
        if folder.exists() {
            std::fs::remove_dir_all(&folder).expect("the last run's folder goes");
        }
        std::fs::create_dir_all(&folder).expect("a folder");
        let (file, json) = (folder.join("one.apk"), folder.join("one.json"));
        let arguments = ["--out", &shown(&file), "--json", &shown(&json)];
        let output = apk(&folder, &arguments).output().expect("it starts");
        let said = text(&output);
        assert!(output.status.success(), "mon3tr-dev apk failed:\n{said}");
        let report = std::fs::read_to_string(&json).expect("the report");
        Self {
            folder,
            file,
            said,
            report: serde_json::from_str(&report).expect("JSON"),
        }
    }

    /// A place for more, by the name of the test that wants it.
    pub(crate) fn place(&self, name: &str) -> PathBuf {
        let place = self.folder.join(name);
        std::fs::create_dir_all(&place).expect("a folder");
        place
    }

    /// The folder of the key that signed.
    pub(crate) fn keys(&self) -> &Path {
        &self.folder
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.file).expect("the package")
    }

    /// Names of the libraries in it with their bytes, and where these start in the package.
    pub(crate) fn libraries(&self) -> Vec<(String, Vec<u8>, u64)> {
        use std::io::Read as _;
        let file = std::fs::File::open(&self.file).expect("the package");
        let mut zip = zip::ZipArchive::new(file).expect("a zip");
        let mut found = Vec::new();
        for index in 0..zip.len() {
            let mut member = zip.by_index(index).expect("a member");
            let name = member.name().expect("a name").into_owned();
            let Some(name) = name.strip_prefix("lib/arm64-v8a/").map(str::to_owned) else {
                assert!(!name.starts_with("lib/"), "{name}");
                continue;
            };
            let mut data = Vec::new();
            member.read_to_end(&mut data).expect("its bytes");
            let start = member.data_start().expect("its place");
            found.push((name, data, start));
        }
        found
    }
}

/// A path as an argument.
pub(crate) fn shown(path: &Path) -> String {
    path.to_str().expect("a plain path").to_owned()
}
