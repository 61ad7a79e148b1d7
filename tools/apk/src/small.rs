//! Reading files that are small where they are what they should be: texts, keys.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// What is read at most: manifests and keys are some kilobytes.
pub(crate) const MAX_BYTES: usize = 1 << 20;

/// The whole file.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(MAX_BYTES as u64 + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() > MAX_BYTES {
        return Err(io::Error::other(format!(
            "it has more than {MAX_BYTES} bytes, and no more are read of such a file"
        )));
    }
    Ok(bytes)
}

/// The whole file, in UTF-8.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|_| io::Error::other("it is not text in UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_files_and_other_bytes_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("file");
        for (bytes, why) in [
            (vec![b'a'; MAX_BYTES + 1], "more than 1048576 bytes"),
            (vec![0xff], "not text"),
        ] {
            std::fs::write(&path, bytes).expect("a file");
            let error = read_text(&path).expect_err(why).to_string();
            assert!(error.contains(why), "{error} should speak of {why}");
        }
        std::fs::write(&path, vec![b'a'; MAX_BYTES]).expect("a file");
        assert_eq!(
            read_text(&path).expect("it is small enough").len(),
            MAX_BYTES
        );
    }
}
