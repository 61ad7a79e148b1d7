//! Versions 2 and 3: header, blocks and extensions in one gzip stream, or bare as some tools leave them.

use std::io::{self, Read};

use flate2::bufread::GzDecoder;

use super::{HEADER, Header, MAGIC, unpack};
use crate::source::Source;
use crate::{Format, Scene, SceneError};

/// Extensions after the blocks are read up to this size.
const MAX_EXTENSIONS: u64 = 1 << 20;

pub(super) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    if let Some(body) = source.bytes.strip_prefix(MAGIC) {
        let header = source.bytes.first_chunk().ok_or_else(|| {
            let (need, have) = (HEADER as u64, body.len() + MAGIC.len());
            source.truncated(Format::Spz { version: 0 }, "its header", need, have)
        })?;
        let header = Header::parse(source, header)?;
        let body = source.bytes.get(HEADER..).unwrap_or_default();
        return split(source, &header, body);
    }
    let mut stream = GzDecoder::new(source.bytes);
    let mut first = Vec::with_capacity(HEADER);
    let broken = |version, error: io::Error| {
        source.damaged(
            Format::Spz { version },
            format!("its gzip stream cannot be unpacked ({error})"),
        )
    };
    stream
        .by_ref()
        .take(HEADER as u64)
        .read_to_end(&mut first)
        .map_err(|error| broken(0, error))?;
    let header = match first.first_chunk() {
        Some(header) if header.starts_with(MAGIC) => Header::parse(source, header)?,
        _ => {
            return Err(SceneError::UnknownFormat {
                name: source.name.to_owned(),
                what: "it is a gzip stream, but not of an .spz scene".to_owned(),
            });
        }
    };
    if header.version >= super::FIRST_ZSTANDARD {
        return Err(source.damaged(
            header.format(),
            "it is in gzip, as only versions before 4 are",
        ));
    }
    // Grows with what the stream yields, and no further than the header's count, which is checked.
    let mut body = Vec::new();
    let need = header.block_bytes() + MAX_EXTENSIONS;
    // To the end, where gzip's checksum is.
    stream
        .take(need + 1)
        .read_to_end(&mut body)
        .map_err(|error| broken(header.version, error))?;
    if body.len() as u64 > need {
        return Err(source.damaged(
            header.format(),
            "its gzip stream goes on after the last Gaussian",
        ));
    }
    split(source, &header, &body)
}

/// Cuts the body into the attributes' blocks and what follows them.
fn split(source: &Source<'_>, header: &Header, body: &[u8]) -> Result<Scene, SceneError> {
    let need = header.block_bytes();
    if (body.len() as u64) < need {
        let what = format!("the attributes of {} Gaussians", header.count);
        return Err(source.truncated(header.format(), what, need, body.len()));
    }
    let mut rest = body;
    let blocks = header.strides().map(|stride| {
        let (block, after) = rest
            .split_at_checked(stride * header.count)
            .unwrap_or_default();
        rest = after;
        block
    });
    unpack(source, header, blocks, rest)
}
