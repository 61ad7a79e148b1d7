//! A writer of `.spz` version 4 for the tests: the payload of version 3 cut into Zstandard streams, whose frames are written
//! here by hand from RFC 8878, so that they can also be wrong.

use crate::expected::Raw;
use crate::writers::spz_payload;

/// Most bytes of a block.
const BLOCK: usize = 128 << 10;

/// One block of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Block<'a> {
    Raw(&'a [u8]),
    /// A byte and how often it is repeated.
    Repeated(u8, usize),
}

/// A frame in one segment that states `size` and has these blocks.
pub(crate) fn frame(size: usize, blocks: &[Block<'_>]) -> Vec<u8> {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0b1010_0000];
    frame.extend(u32::try_from(size).unwrap().to_le_bytes());
    for (index, block) in blocks.iter().enumerate() {
        let (kind, size) = match *block {
            Block::Raw(bytes) => (0, bytes.len()),
            Block::Repeated(_, count) => (1, count),
        };
        let last = u32::from(index + 1 == blocks.len());
        let header = last | kind << 1 | u32::try_from(size).unwrap() << 3;
        frame.extend(&header.to_le_bytes()[..3]);
        match *block {
            Block::Raw(bytes) => frame.extend(bytes),
            Block::Repeated(byte, _) => frame.push(byte),
        }
    }
    frame
}

fn stored(bytes: &[u8]) -> Vec<u8> {
    let blocks: Vec<Block<'_>> = bytes.chunks(BLOCK).map(Block::Raw).collect();
    frame(bytes.len(), &blocks)
}

/// The parts of a file, to be changed before they are joined.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    /// 16 bytes, as in all versions.
    pub(crate) header: Vec<u8>,
    pub(crate) extensions: Vec<u8>,
    /// Each stream with the size that the table states for it.
    pub(crate) streams: Vec<(Vec<u8>, u64)>,
}

impl Parts {
    pub(crate) fn join(&self) -> Vec<u8> {
        let mut file = self.header.clone();
        file[15] = u8::try_from(self.streams.len()).unwrap();
        let table = u32::try_from(32 + self.extensions.len()).unwrap();
        file.extend(table.to_le_bytes());
        file.extend([0; 12]);
        file.extend(&self.extensions);
        for (stream, unpacked) in &self.streams {
            file.extend((stream.len() as u64).to_le_bytes());
            file.extend(unpacked.to_le_bytes());
        }
        for (stream, _) in &self.streams {
            file.extend(stream);
        }
        file
    }
}

pub(crate) fn parts(raws: &[Raw], fractional_bits: u8, flags: u8) -> Parts {
    let payload = spz_payload(raws, 4, fractional_bits, flags);
    let (header, mut rest) = payload.split_at(16);
    let coefficients = raws.first().map_or(0, |raw| raw.rest.len());
    let mut streams = Vec::new();
    for stride in [9, 1, 3, 3, 4, 3 * coefficients] {
        let (block, after) = rest.split_at(stride * raws.len());
        rest = after;
        if !block.is_empty() {
            streams.push((stored(block), block.len() as u64));
        }
    }
    Parts {
        header: header.to_vec(),
        extensions: Vec::new(),
        streams,
    }
}

/// An extension's record.
pub(crate) fn extension(kind: u32, body: &[u8]) -> Vec<u8> {
    let length = u32::try_from(body.len()).unwrap();
    [&kind.to_le_bytes()[..], &length.to_le_bytes(), body].concat()
}

pub(crate) fn spz4(raws: &[Raw], fractional_bits: u8, flags: u8) -> Vec<u8> {
    parts(raws, fractional_bits, flags).join()
}
