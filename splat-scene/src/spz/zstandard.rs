//! Version 4: a header of 32 bytes, extensions, a table of the streams' sizes, and one Zstandard stream for each attribute
//! that has any bytes.

use std::io::Read;

use ruzstd::decoding::StreamingDecoder;

use super::{ATTRIBUTES, Header, unpack};
use crate::source::{Source, bytes_at, u32_at};
use crate::{Format, Scene, SceneError};

const HEADER: usize = 32;
/// An entry of the table: the sizes of a stream, packed and unpacked.
const TABLE_ENTRY: usize = 16;
/// The window that Zstandard's specification asks every decoder to support.
const LEAST_WINDOW: u64 = 8 << 20;

pub(super) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    let bytes = source.bytes;
    let version = u32_at(bytes, 4);
    let Some(start) = bytes.first_chunk::<HEADER>() else {
        let format = Format::Spz { version };
        return Err(source.truncated(format, "its header", HEADER as u64, bytes.len()));
    };
    let header = Header::parse(source, &bytes_at(start, 0))?;
    let format = header.format();
    let [stream_count] = bytes_at(start, 15);
    let present = header.strides().map(|stride| stride * header.count > 0);
    let expected = present.iter().filter(|&&present| present).count();
    if usize::from(stream_count) != expected {
        return Err(source.damaged(
            format,
            format!(
                "it has {stream_count} streams, where {} Gaussians of SH degree {} take {expected}",
                header.count, header.sh_degree
            ),
        ));
    }
    let table_start = u32_at(start, 16) as usize;
    let Some(extensions) = bytes.get(HEADER..table_start.max(HEADER)) else {
        return Err(source.truncated(
            format,
            "the part before its table",
            table_start as u64,
            bytes.len(),
        ));
    };
    if table_start < HEADER {
        return Err(source.damaged(
            format,
            format!("its table begins at byte {table_start}, within the header"),
        ));
    }
    let after = bytes.get(table_start..).unwrap_or_default();
    let table_bytes = TABLE_ENTRY * expected;
    let Some((table, mut streams)) = after.split_at_checked(table_bytes) else {
        return Err(source.truncated(format, "its table", table_bytes as u64, after.len()));
    };
    let (table, _) = table.as_chunks::<TABLE_ENTRY>();
    let mut entries = table.iter();
    let mut blocks: [Vec<u8>; 6] = Default::default();
    for (((block, stride), what), present) in blocks
        .iter_mut()
        .zip(header.strides())
        .zip(ATTRIBUTES)
        .zip(present)
    {
        // An attribute without bytes has no stream.
        let Some(entry) = present.then(|| entries.next()).flatten() else {
            continue;
        };
        let need = stride * header.count;
        let (packed, unpacked) = (
            u64::from_le_bytes(bytes_at(entry, 0)),
            u64::from_le_bytes(bytes_at(entry, 8)),
        );
        if unpacked != need as u64 {
            return Err(source.damaged(
                format,
                format!(
                    "its table says that the {what} have {unpacked} bytes, but {} Gaussians take {need}",
                    header.count
                ),
            ));
        }
        let cut = usize::try_from(packed)
            .ok()
            .and_then(|packed| streams.split_at_checked(packed));
        let Some((stream, rest)) = cut else {
            let what = format!("the stream of the {what}");
            return Err(source.truncated(format, what, packed, streams.len()));
        };
        streams = rest;
        *block = decompress(stream, need).map_err(|why| {
            source.damaged(
                format,
                format!("the stream of the {what} cannot be unpacked ({why})"),
            )
        })?;
    }
    if !streams.is_empty() {
        return Err(source.damaged(
            format,
            format!("{} bytes follow its last stream", streams.len()),
        ));
    }
    unpack(
        source,
        &header,
        blocks.each_ref().map(Vec::as_slice),
        extensions,
    )
}

/// The `need` bytes of a stream that consists of one frame. Memory grows with what the stream yields.
fn decompress(stream: &[u8], need: usize) -> Result<Vec<u8>, String> {
    // A writer that knows the size rounds the window up to a power of two.
    let window = (need as u64).next_power_of_two().max(LEAST_WINDOW);
    let mut decoder = StreamingDecoder::new_with_max_window_size(stream, window)
        .map_err(|error| error.to_string())?;
    let mut block = Vec::new();
    decoder
        .by_ref()
        .take(need as u64 + 1)
        .read_to_end(&mut block)
        .map_err(|error| error.to_string())?;
    if block.len() != need {
        let much = if block.len() > need { "more" } else { "fewer" };
        return Err(format!("it holds {much} than {need} bytes"));
    }
    let after = decoder.into_inner().len();
    if after > 0 {
        return Err(format!("{after} bytes follow its frame"));
    }
    Ok(block)
}
