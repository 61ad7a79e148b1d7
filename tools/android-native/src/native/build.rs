//! Building the receiver for the headset: one call of cargo.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::NativeError;
use super::processor::Processor;
use super::route::Route;
use super::toolchain::{Toolchain, output_of, run};
use super::without_ndk::{self, cargo};
use crate::std_stubs;

/// The purpose of a build, which decides its optimisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// For use.
    Release,
    /// Debugging and the rehearsal: arithmetic and debug assertions are checked, and it is built in half the time.
    Debug,
}

impl Purpose {
    /// The profile of the workspace's manifest.
    fn profile(self) -> &'static str {
        match self {
            Self::Release => "android-release",
            Self::Debug => "android",
        }
    }
}

/// What to build.
#[derive(Debug, Clone)]
pub struct Order<'a> {
    /// The repository.
    pub repo: &'a Path,
    /// The package of it that has the library.
    pub package: &'a str,
    /// The library's name for Rust: `main` becomes `libmain.so`.
    pub library: &'a str,
    /// What for.
    pub purpose: Purpose,
    /// For which processor.
    pub processor: Processor,
    /// Where cargo keeps what it builds, apart from this machine's own.
    pub target: &'a Path,
}

/// The built files.
#[derive(Debug, Clone)]
pub struct Built {
    /// The library as the headset gets it.
    pub library: PathBuf,
    /// The same with names and lines of the source, for backtraces.
    pub symbols: PathBuf,
}

/// Builds the library. Cargo's output goes to the standard error stream.
///
/// # Errors
/// [`NativeError`].
pub fn build(order: &Order<'_>, route: &Route) -> Result<Built, NativeError> {
    let toolchain = Toolchain::find(order.repo, order.processor)?;
    let mut cargo = cargo(order.repo);
    let (profile, target) = (order.purpose.profile(), order.processor.target());
    cargo
        .args(["build", "--locked", "--lib", "--target", target])
        .args(["--profile", profile, "--package", order.package])
        .arg("--target-dir")
        .arg(order.target);
    let mut flags = remapped(order, &toolchain);
    let mut c_flags = vec![format!(
        "-ffile-prefix-map={}=crates",
        cargo_home().display()
    )];
    let linker = match route {
        Route::Ndk { .. } => {
            for option in ["-zmax-page-size=16384", "--no-undefined", "--build-id=sha1"] {
                flags.push(format!("-Clink-arg=-Wl,{option}").into());
            }
            route.compiler(order.processor)
        }
        Route::WithoutNdk { .. } => {
            // The compiler's own headers alone: there are none of a C library, and ring can do without.
            c_flags.extend(["-nostdlibinc".into(), "-DRING_CORE_NOSTDLIBINC=1".into()]);
            c_flags.extend(order.processor.c_flags().map(str::to_owned));
            let folder = order
                .target
                .join(format!("without-ndk-{}", order.processor));
            let folder =
                std::path::absolute(&folder).map_err(NativeError::io("could not find", &folder))?;
            without_ndk::prepare(
                order.repo,
                &toolchain,
                &folder,
                &joined(&flags),
                order.processor,
            )?
        }
    };
    let in_names = target.replace('-', "_");
    let linker_of = format!("CARGO_TARGET_{}_LINKER", in_names.to_uppercase());
    cargo
        .env("CARGO_ENCODED_RUSTFLAGS", joined(&flags))
        .env(linker_of, linker)
        .env(format!("CC_{in_names}"), route.compiler(order.processor))
        .env(format!("AR_{in_names}"), route.archiver())
        .env(format!("CFLAGS_{in_names}"), c_flags.join(" "));
    run(&mut cargo, "to build the receiver for the headset")?;
    let folder = order.target.join(target).join(profile);
    let symbols = folder.join(format!("lib{}.so", order.library));
    std_stubs::check(&symbols)?;
    let library = folder
        .join("stripped")
        .join(format!("lib{}.so", order.library));
    strip(&toolchain, &symbols, &library)?;
    Ok(Built { library, symbols })
}

/// Strips the debug information. The exports stay.
fn strip(toolchain: &Toolchain, from: &Path, to: &Path) -> Result<(), NativeError> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(NativeError::io("could not create", folder))?;
    }
    let libraries = if cfg!(target_os = "macos") {
        "DYLD_LIBRARY_PATH"
    } else {
        "LD_LIBRARY_PATH"
    };
    output_of(
        Command::new(toolchain.objcopy()?)
            // Rust's LLVM, which it finds only where cargo or rustc starts it.
            .env(libraries, toolchain.sysroot.join("lib"))
            .arg("--strip-all")
            .arg(from)
            .arg(to),
    )
    .map(|_| ())
}

/// Rust's options by which no path of this machine gets into the library: two builds of one commit are the same, wherever they are.
/// Of several that fit a path, the last counts.
fn remapped(order: &Order<'_>, toolchain: &Toolchain) -> Vec<OsString> {
    let option = |from: &Path, to: &str| {
        let mut option = OsString::from("--remap-path-prefix=");
        option.push(from);
        option.push(format!("={to}"));
        option
    };
    let target = std::path::absolute(order.target).unwrap_or(order.target.to_owned());
    vec![
        option(&toolchain.sysroot, "rust"),
        option(&cargo_home(), "crates"),
        option(order.repo, "mon3tr"),
        option(&target, "target"),
    ]
}

fn cargo_home() -> PathBuf {
    std::env::var_os("CARGO_HOME").map_or_else(
        || std::env::home_dir().unwrap_or_default().join(".cargo"),
        PathBuf::from,
    )
}

/// Cargo's own separator, so that paths may have blanks.
fn joined(flags: &[OsString]) -> OsString {
    flags.join("\u{1f}".as_ref())
}
