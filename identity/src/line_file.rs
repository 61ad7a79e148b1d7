//! A small file of lines that one program keeps.

use std::fmt::Display;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// Lines in a file, which need not be there: read within bounds, and written whole or not at all, for their owner's eyes only (mode 0600).
#[derive(Debug, Clone)]
pub struct LineFile {
    path: PathBuf,
    most_bytes: u64,
}

impl LineFile {
    /// The file at `path`, of which `most_bytes` are looked at.
    #[must_use]
    pub fn new(path: PathBuf, most_bytes: u64) -> Self {
        Self { path, most_bytes }
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The lines, without their ends; none where there is no file.
    ///
    /// # Errors
    /// If it cannot be read, or is no text.
    pub fn read(&self) -> std::io::Result<Vec<String>> {
        let mut text = String::new();
        match std::fs::File::open(&self.path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            opened => opened?.take(self.most_bytes).read_to_string(&mut text)?,
        };
        Ok(text.lines().map(str::to_owned).collect())
    }

    /// Writes these lines in the place of all that were there.
    ///
    /// # Errors
    /// If they cannot be written; the file is what it was then.
    pub fn write(&self, lines: impl IntoIterator<Item = impl Display>) -> std::io::Result<()> {
        let lines = lines.into_iter().map(|line| format!("{line}\n"));
        let text: String = lines.collect();
        let folder = self.path.parent().unwrap_or(Path::new("."));
        let mut partial = tempfile::NamedTempFile::new_in(folder)?;
        partial.write_all(text.as_bytes())?;
        partial.persist(&self.path)?;
        Ok(())
    }
}
