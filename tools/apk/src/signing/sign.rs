//! Signing a zip where it lies.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use super::block::signing_block;
use super::digest::Pieces;
use super::signer::Signer;
use crate::ApkError;

/// The end of a zip that has no comment.
const END: usize = 22;
const END_MAGIC: [u8; 4] = *b"PK\x05\x06";

/// Puts the signing block before the zip's directory; the file's size then. `path` is what errors call it.
pub(crate) fn sign(mut zip: File, signer: &Signer, path: &Path) -> Result<u64, ApkError> {
    let failed = |source| ApkError::Io {
        what: "could not sign",
        path: path.to_owned(),
        source,
    };
    let tail = Tail::read(&mut zip).map_err(failed)?;
    let digest = tail.digest(&mut zip).map_err(failed)?;
    let block = signing_block(signer, &digest)?;
    tail.write(&mut zip, &block).map_err(failed)
}

/// What comes behind the members.
struct Tail {
    /// Where the directory starts.
    start: u64,
    directory: Vec<u8>,
    end: [u8; END],
}

impl Tail {
    fn read(zip: &mut File) -> io::Result<Self> {
        let size = zip.seek(SeekFrom::End(0))?;
        let end_start = size
            .checked_sub(END as u64)
            .ok_or_else(|| not_plain("it is too short"))?;
        let mut end = [0; END];
        zip.seek(SeekFrom::Start(end_start))?;
        zip.read_exact(&mut end)?;
        let start = u64::from(u32::from_le_bytes([end[16], end[17], end[18], end[19]]));
        let length = u64::from(u32::from_le_bytes([end[12], end[13], end[14], end[15]]));
        // Where the directory does not reach the end, there is more between: the zip has sizes of 64 bits, which Android does not read.
        if !end.starts_with(&END_MAGIC) || start + length != end_start {
            return Err(not_plain("it is larger than 4 GB"));
        }
        let mut directory = Vec::new();
        zip.seek(SeekFrom::Start(start))?;
        zip.take(length).read_to_end(&mut directory)?;
        Ok(Self {
            start,
            directory,
            end,
        })
    }

    /// The end still points to where the signing block will start: so it is signed, and so verifiers put it back.
    fn digest(&self, zip: &mut File) -> io::Result<Vec<u8>> {
        let mut pieces = Pieces::default();
        zip.seek(SeekFrom::Start(0))?;
        pieces.add(zip, self.start)?;
        pieces.add(&mut self.directory.as_slice(), self.directory.len() as u64)?;
        pieces.add(&mut self.end.as_slice(), END as u64)?;
        Ok(pieces.finish())
    }

    fn write(mut self, zip: &mut File, block: &[u8]) -> io::Result<u64> {
        let moved = u32::try_from(self.start + block.len() as u64)
            .map_err(|_| not_plain("it is larger than 4 GB"))?;
        self.end[16..20].copy_from_slice(&moved.to_le_bytes());
        zip.set_len(self.start)?;
        zip.seek(SeekFrom::Start(self.start))?;
        for part in [block, &self.directory, &self.end] {
            zip.write_all(part)?;
        }
        zip.flush()?;
        zip.stream_position()
    }
}

fn not_plain(why: &str) -> io::Error {
    io::Error::other(format!("the zip is not one that can be signed: {why}"))
}
