//! Installable Android packages, written without an Android SDK.
//!
//! An APK is a zip with a manifest in Android's binary XML, a table of resources, libraries that start on page borders, and a block
//! of signatures before the zip's directory. Each of these is one module; [`write()`] puts them together. Nothing here builds native
//! code, and nothing here reads packages: what is written is checked by Android's own programs (`tests/`).

mod archive;
mod binary_xml;
mod chunk;
mod error;
mod manifest;
mod package;
mod resources;
mod signing;
mod small;
mod string_pool;
mod text;

pub use archive::{Member, Source};
pub use error::ApkError;
pub use package::{ABI, Asset, Contents, LIBRARY_ALIGNMENT, Library, Report, write};
pub use signing::Signer;
