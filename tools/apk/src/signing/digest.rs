//! The digest that both schemes sign: of pieces of one megabyte, over what lies before the signing block, the zip's directory, and
//! its end.

use std::io::{self, Read};

use sha2::{Digest, Sha256};

const PIECE: u64 = 1 << 20;

/// Digests pieces of sections; each section starts a piece of its own.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    digests: Vec<u8>,
    count: u32,
}

impl Pieces {
    /// A section of `length` bytes.
    pub(super) fn add(&mut self, section: &mut impl Read, length: u64) -> io::Result<()> {
        let mut left = length;
        let mut buffer = Vec::new();
        while left > 0 {
            let size = left.min(PIECE);
            buffer.clear();
            if section.take(size).read_to_end(&mut buffer)? as u64 != size {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            let marker = [&[0xa5][..], &u32_bytes(size)].concat();
            self.digests.extend(
                Sha256::new()
                    .chain_update(marker)
                    .chain_update(&buffer)
                    .finalize(),
            );
            self.count += 1;
            left -= size;
        }
        Ok(())
    }

    /// The digest of the pieces' digests.
    pub(super) fn finish(self) -> Vec<u8> {
        let marker = [&[0x5a][..], &self.count.to_le_bytes()].concat();
        Sha256::new()
            .chain_update(marker)
            .chain_update(self.digests)
            .finalize()
            .to_vec()
    }
}

/// A piece's length: one megabyte at most.
fn u32_bytes(size: u64) -> [u8; 4] {
    u32::try_from(size).unwrap_or(u32::MAX).to_le_bytes()
}
