//! Extensions of an `.spz` file: records of a type, a length and that many bytes. One of them, Adobe's, states the axes that
//! the Gaussians are stored in. Layout after nianticlabs/spz, `extensions/README.md`.

use crate::axes::Axes;
use crate::axes::Direction;
use crate::source::{Source, bytes_at, u32_at};
use crate::{Format, SceneError};

const COORDINATE_SYSTEM: u32 = 0xADBE_0003;
/// Limits for a camera, which do not change what the Gaussians are.
const SAFE_ORBIT_CAMERA: u32 = 0xADBE_0002;
const RECORD_HEADER: usize = 8;

/// The axes that the extensions state, if they do.
pub(super) fn stated_axes(
    source: &Source<'_>,
    format: Format,
    mut records: &[u8],
) -> Result<Option<Axes>, SceneError> {
    let (mut axes, mut unknown) = (None, 0usize);
    while !records.is_empty() {
        let (kind, length) = (u32_at(records, 0), u32_at(records, 4) as usize);
        let whole = records
            .get(RECORD_HEADER..)
            .and_then(|body| body.split_at_checked(length));
        let Some((body, rest)) = whole else {
            let need = (RECORD_HEADER + length) as u64;
            return Err(source.truncated(format, "an extension", need, records.len()));
        };
        records = rest;
        match kind {
            COORDINATE_SYSTEM if length == 4 => axes = system(source, format, bytes_at(body, 0))?,
            COORDINATE_SYSTEM => {
                let what = format!("its extension for the axes has {length} bytes instead of 4");
                return Err(source.damaged(format, what));
            }
            SAFE_ORBIT_CAMERA => {}
            _ => unknown += 1,
        }
    }
    if unknown > 0 {
        log::warn!(
            "{}: {unknown} of its extensions are not known and are passed over",
            source.name
        );
    }
    Ok(axes)
}

/// The numbered coordinate systems, by what x, y and z point to.
fn system(
    source: &Source<'_>,
    format: Format,
    number: [u8; 4],
) -> Result<Option<Axes>, SceneError> {
    use Direction::{Back, Down, Front, Left, Right, Up};
    const SYSTEMS: [[Direction; 3]; 16] = [
        [Left, Down, Back],
        [Right, Down, Back],
        [Left, Up, Back],
        [Right, Up, Back],
        [Left, Down, Front],
        [Right, Down, Front],
        [Left, Up, Front],
        [Right, Up, Front],
        [Left, Front, Down],
        [Right, Front, Down],
        [Left, Front, Up],
        [Right, Front, Up],
        [Left, Back, Down],
        [Right, Back, Down],
        [Left, Back, Up],
        [Right, Back, Up],
    ];
    let number = u32::from_le_bytes(number);
    let Some(index) = number.checked_sub(1) else {
        log::warn!(
            "{}: its extension for the axes leaves them open",
            source.name
        );
        return Ok(None);
    };
    SYSTEMS
        .get(index as usize)
        .map(|&directions| Some(Axes::new(directions)))
        .ok_or_else(|| {
            source.unsupported(
                format,
                format!("the coordinate system {number} of its extension"),
                "write it without the extension, in axes right, up, back",
            )
        })
}
