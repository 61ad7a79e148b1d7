//! A replacement for an NDK, from Rust and lists of names: libraries to link against, stack unwinding, and a linker that uses both.
//!
//! A library to link against needs no code: the linker asks it for names alone, and the headset has the real one. So each is made
//! from the list of what the platform publishes, and a name that Android does not have is an error of the linker.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::NativeError;
use super::processor::Processor;
use super::toolchain::{Toolchain, output_of, run};
use crate::elf::Platform;

/// An empty archive: the linker needs an input.
const EMPTY_ARCHIVE: &[u8] = b"!<arch>\n";

/// Makes the missing files below `folder`, and returns the linker for cargo: a script whose name tells Rust what kind it is. `flags` are
/// rustc's, as cargo takes them encoded.
pub(super) fn prepare(
    repo: &Path,
    toolchain: &Toolchain,
    folder: &Path,
    flags: &OsStr,
    processor: Processor,
) -> Result<PathBuf, NativeError> {
    let lld = toolchain.linker()?;
    fs::create_dir_all(folder).map_err(NativeError::io("could not create", folder))?;
    write(&folder.join("empty.a"), EMPTY_ARCHIVE)?;
    for (library, names) in Platform::api_29().listed() {
        stand_in(&lld, folder, library, names.iter().copied(), processor)?;
    }
    unwinder(repo, folder, flags, processor)?;
    let script = folder.join("ld.lld");
    write(&script, linker_script(&lld, folder).as_bytes())?;
    make_executable(&script)?;
    Ok(script)
}

/// A shared library that exports names, and nothing else.
fn stand_in<'a>(
    lld: &Path,
    folder: &Path,
    library: &str,
    names: impl Iterator<Item = &'a str>,
    processor: Processor,
) -> Result<(), NativeError> {
    let emulation = processor.linker_emulation();
    let mut options = format!("-m {emulation} -shared -soname {library} -o {library} empty.a\n");
    for name in names {
        // Any address that is not 0, which would be that of a weak symbol.
        let _ = writeln!(options, "--defsym={name}=0x1000");
    }
    let response = format!("{library}.options");
    write(&folder.join(&response), options.as_bytes())?;
    output_of(
        Command::new(lld)
            .current_dir(folder)
            .args(["-flavor", "gnu"])
            .arg(format!("@{response}")),
    )
    .map(|_| ())
}

/// `libunwind.a`, built from a crate.
fn unwinder(
    repo: &Path,
    folder: &Path,
    flags: &OsStr,
    processor: Processor,
) -> Result<(), NativeError> {
    let target = folder.join("unwind");
    let mut cargo = cargo(repo);
    cargo
        .args([
            "build",
            "--release",
            "--locked",
            "--quiet",
            "--target",
            processor.target(),
        ])
        .arg("--manifest-path")
        .arg(repo.join("tools/android-native/unwind/Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .env("CARGO_ENCODED_RUSTFLAGS", flags)
        // The crate uses features of the compiler that are not stable; nothing else is built so.
        .env("RUSTC_BOOTSTRAP", "1");
    run(&mut cargo, "to build the stack unwinder")?;
    let built = target.join(processor.target()).join("release/libunwind.a");
    fs::copy(&built, folder.join("libunwind.a"))
        .map(|_| ())
        .map_err(NativeError::io("could not copy", &built))
}

/// Cargo, without the user's build settings in the environment, and without those that an outer cargo sets for its own package:
/// build scripts look at that, and would run again whenever another package's program asks.
pub(super) fn cargo(repo: &Path) -> Command {
    const FROM_OUTSIDE: [&str; 9] = [
        "CARGO_ENCODED_RUSTFLAGS",
        "RUSTFLAGS",
        "CARGO_TARGET_DIR",
        "CARGO_BUILD_TARGET",
        "CARGO_MANIFEST_DIR",
        "CARGO_MANIFEST_PATH",
        "CARGO_CRATE_NAME",
        "CARGO_BIN_NAME",
        "CARGO_PRIMARY_PACKAGE",
    ];
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    cargo.current_dir(repo);
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if FROM_OUTSIDE.contains(&&*text) || text.starts_with("CARGO_PKG_") {
            cargo.env_remove(&name);
        }
    }
    cargo
}

fn linker_script(lld: &Path, folder: &Path) -> String {
    format!(
        "#!/bin/sh\n# Written by mon3tr-dev apk: links for Android without an NDK.\nexec {} -flavor gnu \"$@\" -L{} \
         -zmax-page-size=16384 --no-undefined --build-id=sha1\n",
        quoted(lld),
        quoted(folder)
    )
}

/// One word of a shell, whatever is in it.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

/// Writes only changed files: cargo links again where the linker's file is newer.
fn write(path: &Path, data: &[u8]) -> Result<(), NativeError> {
    if fs::read(path).is_ok_and(|old| old == data) {
        return Ok(());
    }
    fs::write(path, data).map_err(NativeError::io("could not write", path))
}

#[cfg(unix)]
fn make_executable(path: &Path) -> Result<(), NativeError> {
    use std::os::unix::fs::PermissionsExt as _;
    fs::set_permissions(path, fs::Permissions::from_mode(0o755))
        .map_err(NativeError::io("could not make executable", path))
}

#[cfg(not(unix))]
fn make_executable(_: &Path) -> Result<(), NativeError> {
    Ok(())
}
