//! `.splat` files, as antimatter15's viewer reads them: records of 32 bytes without a header, in COLMAP's axes. Position and
//! scale (not its logarithm) are `f32`; colour, opacity and quaternion w x y z are bytes. Layout after antimatter15/splat,
//! `convert.py`.

use crate::source::{Source, bytes_at, f32_at};
use crate::{Format, SH_C0, Scene, SceneBuilder, SceneError, Splat, frame};

const FORMAT: Format = Format::Splat;
const RECORD: usize = 32;
/// Records looked at, spread over the file, to tell whether it is one.
const SAMPLE: usize = 1024;

/// Whether the content can be records: the format has no magic number. A file that is named `.splat` may hold damaged records
/// (up to half); under any other name each record looked at must be as a writer leaves it.
pub(crate) fn recognise(source: &Source<'_>, named_splat: bool) -> Result<(), SceneError> {
    let bytes = source.bytes;
    let unknown = |what: String| {
        Err(SceneError::UnknownFormat {
            name: source.name.to_owned(),
            what,
        })
    };
    if bytes.is_empty() {
        return unknown("it is empty".to_owned());
    }
    let begins = || {
        let start = bytes.get(..bytes.len().min(8)).unwrap_or_default();
        format!("it begins with the bytes `{}`", start.escape_ascii())
    };
    if !bytes.len().is_multiple_of(RECORD) {
        return if named_splat {
            let whole = bytes.len().next_multiple_of(RECORD) as u64;
            Err(source.truncated(FORMAT, "its last record of 32 bytes", whole, bytes.len()))
        } else {
            unknown(begins())
        };
    }
    let records = bytes.len() / RECORD;
    let looked_at = records.min(SAMPLE);
    let good = (0..looked_at)
        .filter_map(|index| {
            bytes
                .get(index * records / looked_at * RECORD..)?
                .first_chunk()
        })
        .filter(|record| as_written(record))
        .count();
    if good == looked_at || named_splat && 2 * good >= looked_at {
        Ok(())
    } else {
        unknown(format!(
            "{}, and {} of {looked_at} records are none of .splat",
            begins(),
            looked_at - good
        ))
    }
}

/// Whether a record is what a writer leaves: places and sizes within reason, and a quaternion of about unit length.
fn as_written(record: &[u8; RECORD]) -> bool {
    let numbers: [f32; 6] = std::array::from_fn(|index| f32_at(record, 4 * index));
    let [position @ .., _, _, _] = numbers;
    let [_, _, _, scale @ ..] = numbers;
    let length = rotation(record).iter().map(|v| v * v).sum::<f32>().sqrt();
    let position: [f32; 3] = position;
    let scale: [f32; 3] = scale;
    position.iter().all(|v| v.abs() < 1e6)
        && scale.iter().all(|v| (0.0..1e6).contains(v))
        && (0.9..1.1).contains(&length)
}

/// x, y, z and w.
fn rotation(record: &[u8; RECORD]) -> [f32; 4] {
    let [w, x, y, z] = bytes_at(record, 28).map(|byte: u8| (f32::from(byte) - 128.0) / 128.0);
    [x, y, z, w]
}

pub(crate) fn read(source: &Source<'_>) -> Result<Scene, SceneError> {
    let (records, _) = source.bytes.as_chunks::<RECORD>();
    let count = source.checked_count(records.len() as u64)?;
    let mut builder = SceneBuilder::new(0)?;
    builder.reserve(count)?;
    for record in records {
        let [red, green, blue, opacity] =
            bytes_at(record, 24).map(|byte: u8| f32::from(byte) / 255.0);
        let mut splat = Splat {
            position: std::array::from_fn(|axis| f32_at(record, 4 * axis)),
            rotation: rotation(record),
            log_scale: std::array::from_fn(|axis| f32_at(record, 12 + 4 * axis).ln()),
            opacity,
            colour: [red, green, blue].map(|v| (v - 0.5) / SH_C0),
        };
        frame::turn(&mut splat, &mut []);
        builder.push(&splat, &[])?;
    }
    Ok(builder.finish_as(FORMAT, false))
}
