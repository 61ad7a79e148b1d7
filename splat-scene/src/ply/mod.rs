//! PLY files: the header, the elements' places in the body, and the two layouts of Gaussians that are kept in them.
//! Big-endian files, which no trainer writes, are not read.

mod ascii;
mod body;
mod compressed;
mod header;
mod standard;
mod write;

use std::borrow::Cow;

use header::{Encoding, Header};

use crate::source::Source;
use crate::{Format, Scene, SceneError};

/// The limit of 256 Gaussians for each chunk of the compressed layout.
const CHUNK: usize = 256;

pub(crate) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    let (header, body) = Header::parse(source)?;
    let body = match header.encoding {
        Encoding::LittleEndian => Cow::Borrowed(body),
        Encoding::Ascii => Cow::Owned(ascii::to_binary(source, &header, body)?),
    };
    if compressed::recognise(&header) {
        compressed::read(source, &header, &body)
    } else if header.element("vertex").is_some() {
        standard::read(source, &header, &body)
    } else {
        Err(source.damaged(Format::Ply, "it has no element `vertex`"))
    }
}
