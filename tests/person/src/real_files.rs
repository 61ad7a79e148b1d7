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

/// The unpacked MakeHuman package, which `MON3TR_MAKEHUMAN` names; nothing, after a line that says so, where it names none. On CI that is
/// a failure.
pub fn makehuman() -> Option<PathBuf> {
    let found = std::env::var_os("MON3TR_MAKEHUMAN").map(PathBuf::from);
    if found.is_none() {
        let ci = std::env::var("CI").as_deref() == Ok("true");
        assert!(!ci, "MON3TR_MAKEHUMAN must name the MakeHuman data in CI");
        println!("skipped: MON3TR_MAKEHUMAN does not name the MakeHuman data");
    }
    found
}
