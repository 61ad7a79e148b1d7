//! Whether Android will load the libraries of a package: read from their ELF files, without a device.
//!
//! What the platform exports is a list of its own, taken from its published interface (`api-29/`), never from a library of ours.

mod check;
mod library;
mod platform;

pub use check::{Fault, check_library};
pub use library::{ElfError, Library, Undefined};
pub use platform::Platform;
