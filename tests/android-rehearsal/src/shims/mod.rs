//! The shims, compiled by this machine's `cc` from `shims/`.

mod forward;

use android_native::elf::Platform;
use anyhow::{Context, ensure};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const FLAGS: [&str; 8] = [
    "-std=gnu17",
    "-Wall",
    "-Wextra",
    "-Wno-attributes",
    "-O2",
    "-g",
    "-fPIC",
    "-shared",
];

/// The sources.
const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/shims");

/// Compiles the shims into the folder `to`, each by the name that Android has it by.
///
/// # Errors
/// If there is no `cc`, or it does not compile them.
pub fn build(to: &Path) -> anyhow::Result<()> {
    let from = Path::new(SOURCES);
    fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    let platform = Platform::api_29();
    let names = platform
        .listed()
        .flat_map(|(_, names)| names.iter().copied());
    let all = to.join("api_29.c");
    fs::write(&all, list(&names.collect()))?;
    // Without a version of its own to export by, `NAME@LIBC` would be an error.
    let versions = to.join("libc.map");
    fs::write(&versions, "LIBC { global: *; };\n")?;
    let versions = format!("-Wl,--version-script,{}", versions.display());
    let (glibc, own) = (
        forward::of_glibc()?,
        forward::implemented_here(&from.join("libc"))?,
    );
    let forwards = |library: &str| -> anyhow::Result<PathBuf> {
        let file = to.join(format!("{library}.S"));
        let names = platform
            .exports_of(library)
            .with_context(|| format!("no list of {library}"))?;
        let passed_on = names.iter().copied().filter(|name| {
            glibc.contains(*name) && !own.contains(*name) && !forward::is_unlike(name)
        });
        fs::write(&file, forward::assembler(passed_on))?;
        Ok(file)
    };
    let mut sources = vec![all, forwards("libc.so")?];
    for file in fs::read_dir(from.join("libc"))? {
        let path = file?.path();
        if path.extension().is_some_and(|extension| extension == "c") {
            sources.push(path);
        }
    }
    let include = format!("-I{}", from.join("libc").display());
    compile(to, "libc.so", &sources, &[&versions, &include])?;
    // The processor's own functions are in libm, which a library of jumps would not keep by itself.
    for library in ["libm.so", "libdl.so"] {
        let jumps = forwards(library)?;
        compile(
            to,
            library,
            &[jumps],
            &[&versions, "-Wl,--no-as-needed", "-lm"],
        )?;
    }
    compile(to, "liblog.so", &[from.join("liblog.c")], &[])?;
    compile(to, "libandroid.so", &[from.join("libandroid.c")], &[])?;
    compile(to, "libaaudio.so", &[from.join("libaaudio.c")], &[])?;
    let log = to.join("liblog.so").display().to_string();
    compile(to, "libopenxr_loader.so", &[from.join("openxr.c")], &[&log])
}

/// The names, for the shim of `dlsym`.
fn list(names: &BTreeSet<&str>) -> String {
    let mut text = String::from(
        "// Written by the rehearsal's driver: what Android API level 29 exports, sorted as strcmp does.\n\
         #include \"android.h\"\nconst char *const api_29[] = {\n",
    );
    for name in names {
        let _ = writeln!(text, "\"{name}\",");
    }
    text.push_str("};\nconst unsigned api_29_count = sizeof api_29 / sizeof *api_29;\n");
    text
}

/// Makes the library `name` of `sources`.
fn compile(to: &Path, name: &str, sources: &[PathBuf], options: &[&str]) -> anyhow::Result<()> {
    let output = Command::new("cc")
        .args(FLAGS)
        .arg("-o")
        .arg(to.join(name))
        .arg(format!("-Wl,-soname,{name}"))
        .args(sources)
        .args(options)
        .output()
        .context("cc could not be started")?;
    ensure!(
        output.status.success(),
        "the shim {name} cannot be compiled:\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(())
}
