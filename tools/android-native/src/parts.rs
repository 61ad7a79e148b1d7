//! Others' libraries that go into the package: read from where `./run` leaves them, and checked by their hashes.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use sha2::{Digest as _, Sha256};

/// Names the folder of the libraries that every package has.
pub const PARTS: &str = "MON3TR_ANDROID_PARTS";
/// Names the folder of those for the NPU.
pub const QNN_PARTS: &str = "MON3TR_ANDROID_PARTS_QNN";
/// Lists the libraries in its folder.
const LIST: &str = "parts.json";

/// Why a part cannot go into a package.
#[derive(Debug, thiserror::Error)]
pub enum PartsError {
    /// The list cannot be read.
    #[error("{} cannot be read: run ./run setup, which fetches it ({why})", path.display())]
    NoList {
        /// The list.
        path: PathBuf,
        /// Why not.
        why: String,
    },
    /// A library is missing.
    #[error("{} cannot be read: delete its folder and run ./run setup", path.display())]
    NoPart {
        /// The library.
        path: PathBuf,
        /// Why not.
        #[source]
        source: std::io::Error,
    },
    /// A library has another hash than the list says.
    #[error(
        "{} has SHA-256 {found}, and {expected} was fetched: delete its folder and run ./run setup",
        path.display()
    )]
    Changed {
        /// The library.
        path: PathBuf,
        /// Its hash.
        found: String,
        /// The one in the list.
        expected: String,
    },
}

/// One library, read and checked.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its file name, `libonnxruntime.so`.
    pub file: String,
    /// Its version, as its maker numbers them.
    pub version: String,
    /// The archive it was in.
    pub from: String,
    /// Its hash, in hexadecimal.
    pub sha256: String,
    /// Whether the NPU's own processor loads it, not Android.
    pub for_npu: bool,
    /// The file's bytes.
    pub data: Vec<u8>,
}

#[derive(Deserialize)]
struct Entry {
    file: String,
    version: String,
    from: String,
    sha256: String,
    #[serde(default)]
    for_npu: bool,
}

/// Reads every library that the list in `folder` names.
///
/// # Errors
/// [`PartsError`], if the list or a library is missing or not what was fetched.
pub fn read(folder: &Path) -> Result<Vec<Part>, PartsError> {
    let path = folder.join(LIST);
    let no_list = |why: String| PartsError::NoList {
        path: path.clone(),
        why,
    };
    let text = fs::read_to_string(&path).map_err(|error| no_list(error.to_string()))?;
    let entries: Vec<Entry> =
        serde_json::from_str(&text).map_err(|error| no_list(error.to_string()))?;
    entries
        .into_iter()
        .map(|entry| {
            // A file name, not a path out of the folder.
            if entry.file.contains(['/', '\\']) {
                return Err(no_list(format!("{:?} is no file name", entry.file)));
            }
            let path = folder.join(&entry.file);
            let data = fs::read(&path).map_err(|source| PartsError::NoPart {
                path: path.clone(),
                source,
            })?;
            let found = hash(&data);
            if found != entry.sha256 {
                return Err(PartsError::Changed {
                    path,
                    found,
                    expected: entry.sha256,
                });
            }
            Ok(Part {
                file: entry.file,
                version: entry.version,
                from: entry.from,
                sha256: found,
                for_npu: entry.for_npu,
                data,
            })
        })
        .collect()
}

/// The SHA-256 of bytes, in hexadecimal.
#[must_use]
pub fn hash(data: &[u8]) -> String {
    use std::fmt::Write as _;
    Sha256::digest(data)
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}
