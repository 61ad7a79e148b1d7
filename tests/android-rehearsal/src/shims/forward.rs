//! Functions that need no conversion: those that are the same in bionic and glibc are exported by Android's version and jump to glibc's.

use anyhow::Context;
use object::{Object, ObjectSymbol, SymbolKind};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Functions that this machine's C library and its library of mathematics export. The library that a rehearsal runs on is this one or a
/// newer one, which has them all.
pub(super) fn of_glibc() -> anyhow::Result<BTreeSet<String>> {
    let mut functions = BTreeSet::new();
    for library in ["libc.so.6", "libm.so.6"] {
        let output = Command::new("cc")
            .arg(format!("-print-file-name={library}"))
            .output()
            .context("cc could not be started")?;
        let path = String::from_utf8(output.stdout).context("cc names no path")?;
        let path = Path::new(path.trim());
        let data =
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let library = object::File::parse(&*data)
            .with_context(|| format!("{} is no library", path.display()))?;
        for symbol in library.dynamic_symbols() {
            // Those that are chosen at run time by the processor, strcmp among them, count as code too.
            if symbol.kind() == SymbolKind::Text && !symbol.is_undefined() {
                functions.extend(symbol.name().map(str::to_owned));
            }
        }
    }
    Ok(functions)
}

/// Whether what a function works on is larger in glibc than in bionic: it would write past what the app has made for it. A library that
/// asks for one cannot be loaded, and says so.
pub(super) fn is_unlike(name: &str) -> bool {
    const PARTS: [&str; 4] = ["setjmp", "longjmp", "tcgetattr", "tcsetattr"];
    name.starts_with("sem_") || PARTS.iter().any(|part| name.contains(part))
}

/// Assembler that exports each of `names` by the version LIBC, as a jump to the function of that name.
pub(super) fn assembler<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut text = String::from("// Written by the rehearsal's driver (src/shims/forward.rs).\n");
    for name in names {
        let _ = writeln!(
            text,
            ".globl to_{name}\n.type to_{name},@function\n.symver to_{name},{name}@LIBC\nto_{name}: jmp *{name}@GOTPCREL(%rip)"
        );
    }
    text.push_str(".section .note.GNU-stack,\"\",@progbits\n");
    text
}

/// The functions that the files of `folder` implement: those in `ANDROID(...)`.
pub(super) fn implemented_here(folder: &Path) -> anyhow::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for file in std::fs::read_dir(folder)? {
        let path = file?.path();
        if path.extension().is_some_and(|extension| extension == "c") {
            let text = std::fs::read_to_string(&path)?;
            let marked = text.split("\nANDROID(").skip(1);
            names.extend(marked.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())));
        }
    }
    Ok(names)
}
