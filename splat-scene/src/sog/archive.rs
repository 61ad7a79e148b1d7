//! The zip around a SOG scene. Its directory is looked at before the zip reader trusts it, and no member is unpacked
//! beyond what it may have.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use zip::ZipArchive;
use zip::result::ZipError;

use super::meta;
use crate::source::{Source, bytes_at};
use crate::{Format, SceneError};

/// What a zip begins with.
pub(crate) const ZIP_MAGIC: &[u8] = b"PK\x03\x04";

const FORMAT: Format = Format::Sog { version: 0 };
const END_RECORD: usize = 22;
const END_MAGIC: &[u8] = b"PK\x05\x06";
/// A scene has eight members; others may lie beside them.
const MAX_MEMBERS: u16 = 256;
const MAX_DIRECTORY: u32 = 1 << 16;

/// Whether a file is a zip with a `meta.json`, as a SOG scene is. An unreadable file is not.
pub fn is_sog(path: &Path) -> bool {
    let Ok(mut file) = File::open(path) else {
        return false;
    };
    let mut end = [0; END_RECORD];
    let read = file
        .seek(SeekFrom::End(-22))
        .and_then(|place| file.read_exact(&mut end).map(|()| place));
    read.is_ok_and(|place| check_end(&end, place).is_ok())
        && ZipArchive::new(BufReader::new(file))
            .is_ok_and(|zip| zip.index_for_name(meta::NAME).is_some())
}

/// An opened zip.
pub(super) struct Bundle<'a> {
    source: &'a Source<'a>,
    zip: ZipArchive<Cursor<&'a [u8]>>,
}

impl<'a> Bundle<'a> {
    pub(super) fn open(source: &'a Source<'a>) -> Result<Self, SceneError> {
        let end = source.bytes.last_chunk().copied().unwrap_or_default();
        let place = source.bytes.len().saturating_sub(END_RECORD) as u64;
        check_end(&end, place).map_err(|why| source.damaged(FORMAT, why))?;
        let zip = ZipArchive::new(Cursor::new(source.bytes))
            .map_err(|error| source.damaged(FORMAT, format!("its zip cannot be read ({error})")))?;
        if zip.index_for_name(meta::NAME).is_none() {
            return Err(SceneError::UnknownFormat {
                name: source.name.to_owned(),
                what: "it is a zip without a meta.json".to_owned(),
            });
        }
        Ok(Self { source, zip })
    }

    /// A member's content, of at most `limit` bytes.
    pub(super) fn member(&mut self, name: &str, limit: u64) -> Result<Vec<u8>, SceneError> {
        let source = self.source;
        let broken = |why: String| source.damaged(FORMAT, format!("its member {name} {why}"));
        let unreadable = |error: ZipError| broken(format!("cannot be read ({error})"));
        let member = self.zip.by_name(name).map_err(unreadable)?;
        let mut bytes = Vec::new();
        // Grows with what the member yields, whatever size it states.
        member
            .take(limit + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| unreadable(error.into()))?;
        if bytes.len() as u64 > limit {
            return Err(broken(format!("has more than {limit} bytes")));
        }
        Ok(bytes)
    }
}

/// The zip reader allocates for as many members as the end record states. So this checks it first: the record at `place`, the file's
/// end, has no comment, is of one volume, and follows the directory that it states. So the reader takes neither an earlier
/// record nor a 64-bit one instead.
fn check_end(end: &[u8; END_RECORD], place: u64) -> Result<(), String> {
    let volumes: [u8; 4] = bytes_at(end, 4);
    let comment = u16::from_le_bytes(bytes_at(end, 20));
    if !end.starts_with(END_MAGIC) || volumes != [0; 4] || comment != 0 {
        return Err("its zip has no directory at its end".to_owned());
    }
    let size = u32::from_le_bytes(bytes_at(end, 12));
    let start = u32::from_le_bytes(bytes_at(end, 16));
    if u64::from(start) + u64::from(size) != place {
        return Err("its zip's directory is not where the end of the file says".to_owned());
    }
    let members = u16::from_le_bytes(bytes_at(end, 10));
    let directory = u32::from_le_bytes(bytes_at(end, 12));
    if members > MAX_MEMBERS || directory > MAX_DIRECTORY {
        return Err(format!(
            "its zip states {members} members in a directory of {directory} bytes, more than a scene has"
        ));
    }
    Ok(())
}
