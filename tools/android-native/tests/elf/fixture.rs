//! Small libraries for Android, compiled and linked here.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use android_native::elf::Library;
use tempfile::TempDir;

const TARGET: &str = "aarch64-linux-android";

/// A compiler and a linker for the headset, and a folder to use them in.
pub(crate) struct Workshop {
    folder: TempDir,
    linker: PathBuf,
    rustc: PathBuf,
}

fn rustc() -> PathBuf {
    std::env::var_os("RUSTC").unwrap_or("rustc".into()).into()
}

fn printed(rustc: &Path, arguments: &[&str]) -> PathBuf {
    let output = Command::new(rustc)
        .args(arguments)
        .output()
        .expect("rustc runs");
    String::from_utf8(output.stdout)
        .expect("a path")
        .trim()
        .into()
}

/// The fixture; nothing, after a line that says so, where Rust has no standard library for the headset. On CI that is a failure.
pub(crate) fn workshop() -> Option<Workshop> {
    let rustc = rustc();
    if !printed(&rustc, &["--print", "target-libdir", "--target", TARGET]).is_dir() {
        let why = "Rust has no standard library for aarch64-linux-android (./run test gets it)";
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "{why}, and CI must have it"
        );
        println!("skipped: {why}");
        return None;
    }
    let linker = printed(&rustc, &["--print", "target-libdir"]).with_file_name("bin/rust-lld");
    Some(Workshop {
        folder: TempDir::new().expect("a folder"),
        linker,
        rustc,
    })
}

impl Workshop {
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// An object file that has `defined` and calls `called`.
    fn compile(&self, name: &str, defined: &[&str], called: &[&str]) -> PathBuf {
        let mut source = String::from("#![no_std]\n#![allow(unused)]\nunsafe extern \"C\" {\n");
        for name in called {
            source += &format!("fn {name}();\n");
        }
        source += "}\n#[panic_handler] fn panic(_: &core::panic::PanicInfo<'_>) -> ! { loop {} }\n";
        source += "#[unsafe(no_mangle)] pub extern \"C\" fn calls() { unsafe {\n";
        for name in called {
            source += &format!("{name}();\n");
        }
        source += "} }\n";
        for name in defined {
            source += &format!("#[unsafe(no_mangle)] pub extern \"C\" fn {name}() {{}}\n");
        }
        let (from, to) = (self.path("source.rs"), self.path(&format!("{name}.o")));
        fs::write(&from, source).expect("a file");
        self.run(
            Command::new(&self.rustc)
                .args(["--crate-type=lib", "--edition=2024", "--emit=obj"])
                .args(["-Cpanic=abort", "-Copt-level=1", "--target", TARGET, "-o"])
                .arg(&to)
                .arg(&from),
        );
        to
    }

    /// A library `name` that has `defined`, calls `called` and needs the libraries `needed`, which it is linked against stand-ins
    /// for; `options` are the linker's.
    pub(crate) fn link(
        &self,
        name: &str,
        defined: &[&str],
        called: &[&str],
        needed: &[&str],
        options: &[&str],
    ) -> Vec<u8> {
        let object = self.compile(name, defined, called);
        let to = self.path(name);
        let mut command = Command::new(&self.linker);
        command.args([
            "-flavor",
            "gnu",
            "-m",
            "aarch64linux",
            "-shared",
            "-soname",
            name,
        ]);
        command.args(["-zmax-page-size=16384", "--no-as-needed", "-o"]);
        command.arg(&to).arg(&object);
        for library in needed {
            command.arg(self.stand_in(library));
        }
        self.run(command.args(options));
        fs::read(&to).expect("what was linked")
    }

    /// A library without anything in it.
    fn stand_in(&self, name: &str) -> PathBuf {
        let (empty, to) = (self.path("empty.a"), self.path(&format!("stand-in-{name}")));
        fs::write(&empty, "!<arch>\n").expect("a file");
        self.run(
            Command::new(&self.linker)
                .args([
                    "-flavor",
                    "gnu",
                    "-m",
                    "aarch64linux",
                    "-shared",
                    "-soname",
                    name,
                ])
                .arg(&empty)
                .arg("-o")
                .arg(&to),
        );
        to
    }

    fn run(&self, command: &mut Command) {
        let output = command.output().expect("the tool runs");
        assert!(
            output.status.success(),
            "{command:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}

/// As the check reads it.
pub(crate) fn read(name: &str, data: &[u8]) -> Library {
    Library::read(name, data).unwrap_or_else(|error| panic!("{error}"))
}

/// Where the program header of `kind` stands in a 64-bit ELF file, and its place in the file: the layout of the specification, read
/// apart from the code under test.
pub(crate) fn segment(data: &[u8], kind: u32) -> (usize, usize) {
    let number = |at: usize, bytes: usize| {
        data[at..at + bytes]
            .iter()
            .rev()
            .fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte))
    };
    let (table, size, count) = (number(0x20, 8), number(0x36, 2), number(0x38, 2));
    (0..count)
        .map(|index| table + index * size)
        .find(|at| number(*at, 4) == kind as usize)
        .map(|at| (at, number(at + 8, 8)))
        .expect("such a segment")
}
