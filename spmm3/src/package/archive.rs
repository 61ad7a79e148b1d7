//! The zip around the members: deterministic when written, untrusted when read.
//!
//! A package is one plain zip: stored or deflated members at the top level, no comment, no zip64, nothing but what the
//! manifest lists. Nothing is sized by a number from the file before that number is checked.

use super::PackageError;
use sha2::{Digest, Sha256};
use std::io::{Cursor, Read, Seek, SeekFrom, Write};
use zip::read::{ArchiveOffset, Config};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// Most members of a package.
pub const MAX_MEMBERS: usize = 16;
/// Most bytes of all members together, unpacked, and of the file itself.
pub const MAX_BYTES: u64 = 512 << 20;

/// Most bytes of the central directory: 16 entries with short names need a few hundred.
const MAX_DIRECTORY: u64 = 64 << 10;
const END_RECORD: usize = 22;
const ZIP64_LOCATOR: usize = 20;

/// Packs members in the given order; equal members give equal bytes.
pub(super) fn write(members: &[(&str, Vec<u8>)]) -> Result<Vec<u8>, PackageError> {
    let failed = |e: zip::result::ZipError| PackageError::archive(e.to_string());
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for (name, bytes) in members {
        zip.start_file(*name, options).map_err(failed)?;
        zip.write_all(bytes)
            .map_err(|e| PackageError::archive(e.to_string()))?;
    }
    Ok(zip.finish().map_err(failed)?.into_inner())
}

/// An opened archive whose directory has been checked.
pub(super) struct Archive<R> {
    zip: ZipArchive<R>,
}

impl<R: Read + Seek> Archive<R> {
    /// Checks the archive's frame, directory and local headers.
    pub(super) fn open(mut reader: R) -> Result<Self, PackageError> {
        check_end_record(&mut reader)?;
        let refused = |e: zip::result::ZipError| PackageError::archive(e.to_string());
        let config = Config {
            // Bytes before the archive would remain unchecked.
            archive_offset: ArchiveOffset::Known(0),
        };
        let mut zip = ZipArchive::with_config(config, reader).map_err(refused)?;
        if zip.len() > MAX_MEMBERS {
            return Err(PackageError::archive(format!(
                "more than {MAX_MEMBERS} members"
            )));
        }
        zip.validate_header_consistency().map_err(refused)?;
        let mut total = 0u64;
        for index in 0..zip.len() {
            let entry = zip.by_index_data(index).map_err(refused)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            check_name(&name)?;
            if entry.encrypted() {
                return Err(PackageError::member(&name, "encrypted"));
            }
            if !matches!(
                entry.compression(),
                CompressionMethod::Stored | CompressionMethod::Deflated
            ) {
                return Err(PackageError::member(&name, "neither stored nor deflated"));
            }
            total = total.saturating_add(entry.size());
        }
        if total > MAX_BYTES {
            let reason = format!("unpacks to {total} bytes, more than {MAX_BYTES}");
            return Err(PackageError::archive(reason));
        }
        Ok(Self { zip })
    }

    /// Names of the members, in the directory's order.
    pub(super) fn names(&self) -> Vec<String> {
        self.zip
            .file_names_raw()
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect()
    }

    /// Unpacks member `name`, which must hold at most `limit` bytes and as many as its header says.
    pub(super) fn unpack(&mut self, name: &str, limit: u64) -> Result<Vec<u8>, PackageError> {
        let refused = |reason: String| PackageError::member(name, reason);
        let file = self
            .zip
            .by_name(name)
            .map_err(|e| PackageError::member(name, e.to_string()))?;
        let declared = file.size();
        if declared > limit {
            return Err(refused(format!(
                "{declared} bytes, more than the {limit} it may have"
            )));
        }
        // A deflated stream grows at most 1032-fold, so that a small file cannot reserve much by declaring it.
        let plausible = file.compressed_size().saturating_mul(1032);
        if declared > plausible.saturating_add(64) {
            return Err(refused("declares more bytes than it can hold".into()));
        }
        let mut bytes = Vec::with_capacity(usize::try_from(declared).unwrap_or(0));
        file.take(declared.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|e| refused(format!("does not unpack: {e}")))?;
        if bytes.len() as u64 != declared {
            return Err(refused(format!(
                "does not unpack to the {declared} bytes that its header declares"
            )));
        }
        Ok(bytes)
    }
}

/// SHA-256 in lower-case hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// The zip reader trusts the end record's counts while it reads the directory; so this checks them first.
fn check_end_record<R: Read + Seek>(reader: &mut R) -> Result<(), PackageError> {
    let refused = |reason: &str| Err(PackageError::archive(reason));
    let unreadable = |e: std::io::Error| PackageError::archive(e.to_string());
    let length = reader.seek(SeekFrom::End(0)).map_err(unreadable)?;
    if length > MAX_BYTES {
        return refused("the file is larger than any package");
    }
    let mut tail = [0u8; END_RECORD + ZIP64_LOCATOR];
    let Some(tail_start) = length.checked_sub(tail.len() as u64) else {
        return refused("too short to be a zip archive");
    };
    reader
        .seek(SeekFrom::Start(tail_start))
        .and_then(|_| reader.read_exact(&mut tail))
        .and_then(|()| reader.seek(SeekFrom::Start(0)))
        .map_err(unreadable)?;
    let (locator, end) = tail.split_at(ZIP64_LOCATOR);
    if !end.starts_with(b"PK\x05\x06") {
        return refused("no zip directory at its end");
    }
    if locator.starts_with(b"PK\x06\x07") {
        return refused("a zip64 archive");
    }
    let word = |at: usize| u64::from(u16::from_le_bytes([end[at], end[at + 1]]));
    let double = |at: usize| word(at) | word(at + 2) << 16;
    if (word(4), word(6), word(20)) != (0, 0, 0) {
        return refused("split over disks, or followed by a comment");
    }
    let (entries, size, start) = (word(10), double(12), double(16));
    if entries > MAX_MEMBERS as u64 || entries != word(8) {
        return Err(PackageError::archive(format!(
            "its directory counts {entries} members, but a package has at most {MAX_MEMBERS}"
        )));
    }
    if size > MAX_DIRECTORY || start + size != length - END_RECORD as u64 {
        return refused("its directory is not where its end record says");
    }
    Ok(())
}

/// Members stand at the top level under plain names.
fn check_name(name: &str) -> Result<(), PackageError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    if name.is_empty() || name.len() > 64 || name.starts_with('.') || !name.chars().all(plain) {
        return Err(PackageError::archive(format!(
            "a member has the unusable name {name:?}"
        )));
    }
    Ok(())
}
