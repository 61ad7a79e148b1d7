//! The zip: the same members give the same bytes, and what Android maps into memory starts where it must.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

use crate::ApkError;

/// Where a member's bytes come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A file, read when the package is written.
    File(PathBuf),
    /// These bytes.
    Bytes(Vec<u8>),
}

/// How a member is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Storage {
    Deflated,
    /// As it is, starting at a multiple of this.
    Stored {
        alignment: u16,
    },
}

/// What is stored is read by words where it lies.
pub(crate) const STORED: Storage = Storage::Stored { alignment: 4 };

/// A member of a package that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name in the package.
    pub name: String,
    /// Its bytes, unpacked.
    pub size: u64,
}

/// A zip while it is written.
#[derive(Debug)]
pub(crate) struct Archive<W: Write + Seek> {
    zip: ZipWriter<W>,
    names: BTreeSet<String>,
    members: Vec<Member>,
}

impl<W: Read + Write + Seek> Archive<W> {
    pub(crate) fn new(writer: W) -> Self {
        Self {
            zip: ZipWriter::new(writer),
            names: BTreeSet::new(),
            members: Vec::new(),
        }
    }

    pub(crate) fn add(
        &mut self,
        name: &str,
        source: &Source,
        storage: Storage,
    ) -> Result<(), ApkError> {
        check_name(name).map_err(|why| ApkError::Member {
            name: name.to_owned(),
            why,
        })?;
        if !self.names.insert(name.to_owned()) {
            return Err(ApkError::Member {
                name: name.to_owned(),
                why: "there are two of this name".into(),
            });
        }
        let failed = |source| ApkError::Zip {
            name: name.to_owned(),
            source,
        };
        // Neither the time nor the machine that it was written on may show.
        let options = SimpleFileOptions::default()
            .last_modified_time(DateTime::DEFAULT)
            .system(System::Unix)
            .unix_permissions(0o644);
        let options = match storage {
            Storage::Deflated => options.compression_method(CompressionMethod::Deflated),
            Storage::Stored { alignment } => options
                .compression_method(CompressionMethod::Stored)
                .with_android_alignment(alignment),
        };
        self.zip.start_file(name, options).map_err(failed)?;
        let written = match source {
            Source::Bytes(bytes) => self.zip.write_all(bytes).map(|()| bytes.len() as u64),
            Source::File(path) => self.copy(path)?,
        };
        let size = written.map_err(|error| failed(error.into()))?;
        self.members.push(Member {
            name: name.to_owned(),
            size,
        });
        Ok(())
    }

    /// What failed on the file's side is an error of its own.
    fn copy(&mut self, path: &Path) -> Result<io::Result<u64>, ApkError> {
        let mut file = File::open(path).map_err(ApkError::io("could not read", path))?;
        let mut buffer = vec![0; 1 << 16];
        let mut size = 0;
        loop {
            let count = file
                .read(&mut buffer)
                .map_err(ApkError::io("could not read", path))?;
            let Some(part) = buffer.get(..count).filter(|part| !part.is_empty()) else {
                return Ok(Ok(size));
            };
            if let Err(error) = self.zip.write_all(part) {
                return Ok(Err(error));
            }
            size += count as u64;
        }
    }

    pub(crate) fn finish(self) -> Result<(W, Vec<Member>), ApkError> {
        let writer = self.zip.finish().map_err(|source| ApkError::Zip {
            name: "the directory".into(),
            source,
        })?;
        Ok((writer, self.members))
    }
}

/// A member's name must not lead out of the folder it is unpacked into, and be the same to every reader.
fn check_name(name: &str) -> Result<(), String> {
    let bad_part = |part: &str| part.is_empty() || part == "." || part == "..";
    if name.split('/').any(bad_part)
        || name.contains(['\\', ':'])
        || name.chars().any(char::is_control)
        || name.len() > 1000
    {
        return Err("a name is a relative path with / between its parts, without . and .., backslashes, colons or control characters".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for name in [
            "", "/a", "a/", "a//b", "../a", "a/../b", "a/./b", r"a\b", "c:a", "a\0b", "a\nb",
        ] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
        for name in [
            "AndroidManifest.xml",
            "assets/a b/ü.bin",
            "lib/arm64-v8a/libc++_shared.so",
            "a..b",
        ] {
            assert_eq!(check_name(name), Ok(()), "{name:?}");
        }
    }
}
