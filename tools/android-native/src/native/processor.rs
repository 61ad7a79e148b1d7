//! Processors that the app is built for.

use std::fmt;

/// A processor that Android runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processor {
    /// A Quest's.
    Arm64,
    /// A PC's: `tests/android-rehearsal` executes that build on Linux.
    X86_64,
}

impl Processor {
    /// Rust's name for Android on it, which is LLVM's too.
    #[must_use]
    pub fn target(self) -> &'static str {
        match self {
            Self::Arm64 => "aarch64-linux-android",
            Self::X86_64 => "x86_64-linux-android",
        }
    }

    /// LLD's `-m` option, where no linked file says the target.
    pub(super) fn linker_emulation(self) -> &'static str {
        match self {
            Self::Arm64 => "aarch64linux",
            Self::X86_64 => "elf_x86_64",
        }
    }

    /// What the C in dependencies needs besides, where there are no headers of a C library.
    pub(super) fn c_flags(self) -> impl Iterator<Item = &'static str> {
        // clang's header of vector instructions asks for posix_memalign in stdlib.h, unless its include guard is set.
        let only_x86 = (self == Self::X86_64).then_some("-D__MM_MALLOC_H=1");
        only_x86.into_iter()
    }
}

impl fmt::Display for Processor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Arm64 => "arm64",
            Self::X86_64 => "x86_64",
        })
    }
}
