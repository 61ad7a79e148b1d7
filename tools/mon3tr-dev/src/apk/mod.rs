//! `mon3tr-dev apk`: the receiver as a package that a Quest installs. Builds its library, takes others' that `./run` has fetched, checks
//! all of them, and has Android's own programs pack and sign the lot.

mod gather;
mod install;
mod key_store;
mod licences;
mod pack;
mod report;
#[cfg(test)]
mod tests;
mod tools;

use android_native::native::{Order, Processor, Purpose, Route, build};
use anyhow::{Context, ensure};
use gather::{Gathered, Member};
use key_store::Key;
use mon3tr::device_options::cache;
use mon3tr::report::check_writable;
use pack::Contents;
use std::path::{Path, PathBuf};
use tools::Tools;

/// The package of this repository that is the app, and its library.
const PACKAGE: &str = "mon3tr-android";
const LIBRARY: &str = "main";
/// The app's name for Android, as the manifest says it.
const APPLICATION: &str = "org.mon3tr.quest";
/// The key that signs where none is given, in the cache: once it is deleted, the app has to be uninstalled before the next one.
const DEBUG_KEY: &str = "android-debug.p12";

/// Options of `apk`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Build it for use, not for debugging
    #[arg(long)]
    release: bool,
    /// Add ONNX Runtime's QNN plugin and Qualcomm's libraries, for the NPU (Qualcomm's own licence)
    #[arg(long)]
    with_qnn: bool,
    /// Install it on the headset that adb sees, and start it
    #[arg(long)]
    install: bool,
    /// The package
    #[arg(long, value_name = "FILE", default_value = "mon3tr-quest3.apk")]
    out: PathBuf,
    /// Sign with the key in this key store, PKCS #12 or Java's own [default: a debug key, made once and kept]
    #[arg(long, value_name = "FILE", requires = "key_pass")]
    keystore: Option<PathBuf>,
    /// The key store's password
    #[arg(
        long,
        value_name = "PASSWORD",
        env = "MON3TR_KEY_PASS",
        hide_env_values = true
    )]
    key_pass: Option<String>,
    /// Which key of the key store, where it has several
    #[arg(long, value_name = "ALIAS", requires = "keystore")]
    key_alias: Option<String>,
    /// Write what is in the package, and what was checked, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs `apk`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    let repo = repository()?;
    check_writable(&options.out)?;
    if let Some(json) = &options.json {
        check_writable(json)?;
    }
    if let Some(store) = &options.keystore {
        ensure!(store.is_file(), "there is no key store {}", store.display());
    }
    let route = Route::find(Some(&repo.join(".cache/clang/run")))?;
    let parts = gather::parts(&repo, options.with_qnn)?;
    let tools = Tools::find(&repo)?;
    let key = key(options, &tools)?;
    eprintln!(
        "building the receiver for the headset, {}",
        route.describe()
    );
    let target = repo.join("target/android");
    let built = build(
        &Order {
            repo: &repo,
            package: PACKAGE,
            library: LIBRARY,
            purpose: if options.release {
                Purpose::Release
            } else {
                Purpose::Debug
            },
            processor: Processor::Arm64,
            target: &target,
        },
        &route,
    )?;
    let gathered = Gathered::new(&built, parts)?;
    let texts = licences::texts(&repo)?;
    let contents = Contents {
        licences: texts
            .iter()
            .map(|(name, text)| (*name, text.as_slice()))
            .collect(),
        manifest: gathered.manifest(&repo, &route)?,
        resources: &repo.join("android/res"),
        debuggable: !options.release,
        libraries: gathered
            .members
            .iter()
            .map(|Member { part, .. }| (part.file.as_str(), part.data.as_slice()))
            .collect(),
    };
    let bytes = contents.pack(&tools, &key, &options.out)?;
    // Beside the package: what turns the addresses of a backtrace into lines.
    let symbols = options.out.with_extension("symbols.so");
    std::fs::copy(&built.symbols, &symbols)
        .with_context(|| format!("could not write {}", symbols.display()))?;
    let report = report::Report::new(options, &route, &gathered, &key, bytes, &symbols);
    print!("{report}");
    report.write_json(options.json.as_deref())?;
    if options.install {
        install::install(&options.out, APPLICATION)?;
    }
    Ok(())
}

/// The repository that the app is built from: cargo's where cargo runs this program, else the one around the current folder. The program itself knows no
/// folder of the machine that it was built on.
fn repository() -> anyhow::Result<PathBuf> {
    let current = std::env::current_dir().context("could not find the current folder")?;
    let start = std::env::var_os("CARGO_MANIFEST_DIR").map_or(current, PathBuf::from);
    let has_sources = |folder: &&Path| folder.join("android/AndroidManifest.xml").is_file();
    let repo = start.ancestors().find(has_sources).with_context(|| {
        format!(
            "the app is built from its sources, and neither {} nor a folder above it has android/AndroidManifest.xml: run this in a clone of the repository",
            start.display()
        )
    })?;
    repo.canonicalize()
        .with_context(|| format!("could not find {}", repo.display()))
}

fn key(options: &Options, tools: &Tools) -> anyhow::Result<Key> {
    let Some(store) = &options.keystore else {
        let folder = cache()?;
        mon3tr::device_options::make_folder(&folder)?;
        return Key::debug(tools, &folder.join(DEBUG_KEY));
    };
    let password = options.key_pass.as_deref().unwrap_or_default();
    Key::read(tools, store, password, options.key_alias.as_deref())
}
