//! The package: aapt2 makes the manifest and the resources, the libraries are added where Android can map them, and apksigner signs.

use super::key_store::Key;
use super::tools::{Tools, succeed};
use anyhow::Context;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

/// The processor that libraries are for.
const ABI: &str = "arm64-v8a";
/// The folder of licences in the package.
const LICENCES: &str = "assets/licences";
/// Where libraries start in the package, in bytes: at the largest page that Android has, so that they can be mapped as they lie.
const LIBRARY_ALIGNMENT: u16 = 16 * 1024;

/// What goes into a package.
pub(super) struct Contents<'a> {
    /// The text of `AndroidManifest.xml`.
    pub(super) manifest: String,
    /// The folder `res/`.
    pub(super) resources: &'a Path,
    /// Whether a debugger may attach to the app, and adb read its files.
    pub(super) debuggable: bool,
    /// Texts of licences, which have to go with the programs, each with its name.
    pub(super) licences: Vec<(&'a str, &'a [u8])>,
    /// Shared libraries for [`ABI`], each as `libNAME.so` with its bytes.
    pub(super) libraries: Vec<(&'a str, &'a [u8])>,
}

impl Contents<'_> {
    /// Writes a signed package to `path`; its bytes. Equal contents give equal bytes but for the signatures. An older package is
    /// replaced once the new one is complete.
    pub(super) fn pack(&self, tools: &Tools, key: &Key, path: &Path) -> anyhow::Result<u64> {
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let place = tempfile::tempdir_in(folder)
            .with_context(|| format!("could not make a folder in {}", folder.display()))?;
        let path_to = |name: &str| place.path().join(name);
        let (linked, unsigned, signed) = (
            path_to("linked.apk"),
            path_to("unsigned.apk"),
            path_to("signed.apk"),
        );
        self.link(tools, place.path(), &linked)?;
        self.add_files(&linked, &unsigned)
            .context("could not add libraries and licences to the package")?;
        let mut sign = key.sign(tools);
        // Every Android that the app runs on reads the third scheme; the second is there for stores and programs that do not.
        sign.args(["--v1-signing-enabled", "false"]);
        sign.args(["--v2-signing-enabled", "true"]);
        sign.args(["--v3-signing-enabled", "true"]);
        // A file of its own, for installing while it is transferred.
        sign.args(["--v4-signing-enabled", "false"]);
        succeed(sign.arg("--out").arg(&signed).arg(&unsigned))?;
        fs::rename(&signed, path)
            .and_then(|()| fs::metadata(path))
            .map(|file| file.len())
            .with_context(|| format!("could not write {}", path.display()))
    }

    /// The package without libraries. `place` is for what is made on the way.
    fn link(&self, tools: &Tools, place: &Path, package: &Path) -> anyhow::Result<()> {
        let (manifest, compiled) = (place.join("AndroidManifest.xml"), place.join("res.zip"));
        fs::write(&manifest, &self.manifest)
            .with_context(|| format!("could not write {}", manifest.display()))?;
        let mut compile = tools.aapt2();
        compile.args(["compile", "--dir"]).arg(self.resources);
        succeed(compile.arg("-o").arg(&compiled))?;
        let mut link = tools.aapt2();
        link.args(["link", "-I"]).arg(&tools.framework);
        link.arg("--manifest").arg(&manifest);
        link.args(self.debuggable.then_some("--debug-mode"));
        succeed(link.arg("-o").arg(package).arg(&compiled))
    }

    /// `package` from what is in `linked`, the licences and the libraries.
    fn add_files(&self, linked: &Path, package: &Path) -> anyhow::Result<()> {
        let mut linked = ZipArchive::new(File::open(linked)?)?;
        let mut zip = ZipWriter::new(File::create_new(package)?);
        // apksigner aligns these, to 4 bytes.
        for index in 0..linked.len() {
            zip.raw_copy_file(linked.by_index_raw(index)?)?;
        }
        // Neither the time nor the machine that it was written on may show.
        let options = SimpleFileOptions::default()
            .last_modified_time(DateTime::DEFAULT)
            .system(System::Unix)
            .unix_permissions(0o644)
            .compression_method(CompressionMethod::Deflated);
        let mut licences = self.licences.clone();
        licences.sort_unstable();
        for (name, text) in licences {
            zip.start_file(format!("{LICENCES}/{name}"), options)?;
            zip.write_all(text)?;
        }
        let options = options
            .compression_method(CompressionMethod::Stored)
            .with_android_alignment(LIBRARY_ALIGNMENT);
        let mut libraries = self.libraries.clone();
        libraries.sort_unstable();
        for (name, data) in libraries {
            zip.start_file(format!("lib/{ABI}/{name}"), options)?;
            zip.write_all(data)?;
        }
        zip.finish()?;
        Ok(())
    }
}
