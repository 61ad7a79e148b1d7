//! The installed Rust toolchain, and its tools.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::NativeError;
use super::processor::Processor;

/// The compiler that a repository is built with, and programs of its own.
#[derive(Debug)]
pub(super) struct Toolchain {
    /// `rust-lld` and `rust-objcopy` lie here.
    bin: PathBuf,
    /// What file paths of the standard library's sources begin with in its debug information, if they are installed.
    pub(super) sysroot: PathBuf,
}

impl Toolchain {
    /// The one that rustup chooses in `repo`.
    pub(super) fn find(repo: &Path, processor: Processor) -> Result<Self, NativeError> {
        let print = |what: &[&str]| {
            let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or("rustc".into()));
            rustc.current_dir(repo).args(what);
            output_of(&mut rustc).map(|text| PathBuf::from(text.trim()))
        };
        let target = print(&["--print", "target-libdir", "--target", processor.target()])?;
        if !target.is_dir() {
            return Err(NativeError::NoTarget {
                target: processor.target().to_owned(),
            });
        }
        let host = print(&["--print", "target-libdir"])?;
        let sysroot = print(&["--print", "sysroot"])?;
        let bin = host.with_file_name("bin");
        Ok(Self { bin, sysroot })
    }

    pub(super) fn linker(&self) -> Result<PathBuf, NativeError> {
        self.tool("rust-lld")
    }

    pub(super) fn objcopy(&self) -> Result<PathBuf, NativeError> {
        self.tool("rust-objcopy")
    }

    fn tool(&self, name: &str) -> Result<PathBuf, NativeError> {
        let tool = self.bin.join(name);
        if tool.is_file() {
            Ok(tool)
        } else {
            Err(NativeError::NoTool(tool))
        }
    }
}

/// What a program that succeeds writes to its standard output.
pub(super) fn output_of(command: &mut Command) -> Result<String, NativeError> {
    let program = name_of(command.get_program());
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().map_err(|source| NativeError::NotStarted {
        program: program.clone(),
        source,
    })?;
    if !status.success() {
        return Err(NativeError::Failed {
            program,
            what: format!(": {}", String::from_utf8_lossy(&stderr).trim()),
        });
    }
    Ok(String::from_utf8_lossy(&stdout).into_owned())
}

/// Runs a program that prints to the user's terminal.
pub(super) fn run(command: &mut Command, what: &str) -> Result<(), NativeError> {
    let program = name_of(command.get_program());
    let status = command.status().map_err(|source| NativeError::NotStarted {
        program: program.clone(),
        source,
    })?;
    if status.success() {
        return Ok(());
    }
    Err(NativeError::Failed {
        program,
        what: format!(" ({status}) {what}: what it said is above"),
    })
}

fn name_of(program: &OsStr) -> String {
    Path::new(program)
        .file_name()
        .unwrap_or(program)
        .to_string_lossy()
        .into_owned()
}
