//! The networks that `./run test` fetched, and one that is here.

use std::path::{Path, PathBuf};

/// A file that `reference.py` wrote.
pub(crate) fn reference(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    std::fs::read(folder.join(name)).unwrap()
}

/// The bytes of `name`.tflite, or nothing after a line that says why; on CI that is a failure.
pub(crate) fn network(name: &str) -> Option<Vec<u8>> {
    if name == "operators" {
        return Some(reference("operators.tflite"));
    }
    let why = match std::env::var_os("MON3TR_NETWORKS") {
        None => "MON3TR_NETWORKS is not set; ./run test fetches the networks".to_owned(),
        Some(folder) => {
            let path = PathBuf::from(folder).join(format!("{name}.tflite"));
            match std::fs::read(&path) {
                Ok(bytes) => return Some(bytes),
                Err(error) => format!("{}: {error}", path.display()),
            }
        }
    };
    skip(&why);
    None
}

/// Says that a test is skipped; on CI fails.
pub(crate) fn skip(why: &str) {
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
    println!("skipped: {why}");
}
