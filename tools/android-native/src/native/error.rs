//! The errors of building the library.

use std::io;
use std::path::PathBuf;

use crate::std_stubs::StubError;

/// Why there is no library.
#[derive(Debug, thiserror::Error)]
pub enum NativeError {
    /// A variable does not name an NDK.
    #[error("{variable} names {}, which is no NDK for this machine: {why}", root.display())]
    NoNdk {
        /// The variable.
        variable: String,
        /// What it names.
        root: PathBuf,
        /// What is missing in it.
        why: String,
    },
    /// Nothing compiles C for Android.
    #[error(
        "there is neither an NDK (ANDROID_NDK_HOME) nor a clang to do without one: run ./run setup, which fetches a clang, or set MON3TR_CLANG"
    )]
    NoCompiler,
    /// The variable for it names none.
    #[error("MON3TR_CLANG names {}, and there is no such file", .0.display())]
    NoSuchClang(PathBuf),
    /// Rust does not have the target.
    #[error("Rust has no standard library for {target}: run `rustup target add {target}`")]
    NoTarget {
        /// The target.
        target: String,
    },
    /// Rust's own linker and stripper are not where rustup puts them.
    #[error(
        "this Rust has no {}: it comes with Rust from https://rustup.rs; another Rust needs an NDK (ANDROID_NDK_HOME)",
        .0.display()
    )]
    NoTool(PathBuf),
    /// A program did not start.
    #[error("{program} could not be started")]
    NotStarted {
        /// The program.
        program: String,
        /// Why not.
        #[source]
        source: io::Error,
    },
    /// A program failed; its output went to the standard error stream.
    #[error("{program} failed{what}")]
    Failed {
        /// The program.
        program: String,
        /// What it was to do, and its output, where that was not shown already.
        what: String,
    },
    /// The library calls functions that are only stubs on Android.
    #[error(transparent)]
    Stub(#[from] StubError),
    /// A file could not be read or written.
    #[error("{what} {}", path.display())]
    Io {
        /// What was being done.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why not.
        #[source]
        source: io::Error,
    },
}

impl NativeError {
    pub(super) fn io(what: &'static str, path: &std::path::Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io {
            what,
            path: path.to_owned(),
            source,
        }
    }
}
