//! Telling the file formats apart by content.

use std::path::Path;

use crate::source::Source;
use crate::{SceneError, sog, splat, spz};

/// Which reader a file is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reader {
    Ply,
    Splat,
    Spz,
    /// A zip with a `meta.json`.
    SogBundle,
    /// The `meta.json` of files beside it.
    SogMeta,
}

pub(crate) fn detect(source: &Source<'_>) -> Result<Reader, SceneError> {
    let bytes = source.bytes;
    if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n") {
        return Ok(Reader::Ply);
    }
    // An .spz up to version 3 is a gzip stream; some tools also leave the payload bare, as version 4 is.
    if bytes.starts_with(&[0x1f, 0x8b]) || bytes.starts_with(spz::MAGIC) {
        return Ok(Reader::Spz);
    }
    if bytes.starts_with(sog::ZIP_MAGIC) {
        return Ok(Reader::SogBundle);
    }
    let named_splat = Path::new(source.name)
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("splat"));
    if !named_splat && sog::is_json_object(bytes) {
        return Ok(Reader::SogMeta);
    }
    splat::recognise(source, named_splat)?;
    Ok(Reader::Splat)
}
