//! Finding the real recordings and captures that some tests read, or skipping for a stated reason.

use std::path::{Path, PathBuf};

/// A file or folder of `shared/data`, which lies beside the repository; nothing, after a line that says
/// so, where it is missing. On CI that is a failure.
pub fn real_file(name: impl AsRef<Path>) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "{} is missing, and CI must have it",
        path.display()
    );
    println!("skipped: {} is not here", path.display());
    None
}
