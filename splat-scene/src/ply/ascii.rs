//! The body of a PLY file written as text, put into the bytes that a binary file of the same header has. So there is one
//! reader for both; text is for small files made by hand, and its speed matters little.

use std::str::FromStr;

use super::header::{Header, Kind};
use crate::source::Source;
use crate::{Format, SceneError};

/// More text than this is no file made by hand; its numbers could take four times as much memory.
const MOST_TEXT: usize = 1 << 28;

pub(super) fn to_binary(
    source: &Source<'_>,
    header: &Header,
    text: &[u8],
) -> Result<Vec<u8>, SceneError> {
    if text.len() > MOST_TEXT {
        return Err(source.unsupported(
            Format::Ply,
            format!("a text of {} MB", text.len() / 1_000_000),
            "write it as binary_little_endian",
        ));
    }
    let mut words = text
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty());
    let mut binary = Vec::new();
    for element in &header.elements {
        // An element without properties takes no text, however many rows it claims.
        let rows = if element.properties.is_empty() {
            0
        } else {
            element.count
        };
        for row in 0..rows {
            for property in &element.properties {
                let mut value = || {
                    let word = words.next().ok_or_else(|| {
                        let name = &element.name;
                        let count = element.count;
                        source.damaged(
                            Format::Ply,
                            format!(
                                "its text ends in row {row} of the {count} of element `{name}`"
                            ),
                        )
                    })?;
                    number(word).ok_or_else(|| {
                        let (element, property) = (&element.name, &property.name);
                        let shown: String = String::from_utf8_lossy(word).chars().take(20).collect();
                        source.damaged(
                            Format::Ply,
                            format!("`{property}` in row {row} of element `{element}` is `{shown}`, not a number"),
                        )
                    })
                };
                let mut items = 1.0;
                if let Some(kind) = property.list_count {
                    items = value()?;
                    append(&mut binary, kind, items);
                }
                // Counted in f64, a list's length needs no cast; the text's end bounds it.
                let mut done = 0.0;
                while done < items {
                    append(&mut binary, property.kind, value()?);
                    done += 1.0;
                }
            }
        }
    }
    Ok(binary)
}

fn number(word: &[u8]) -> Option<f64> {
    f64::from_str(std::str::from_utf8(word).ok()?).ok()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the header's type is what the value is rounded or clamped to"
)]
fn append(binary: &mut Vec<u8>, kind: Kind, value: f64) {
    match kind {
        Kind::I8 => binary.extend((value as i8).to_le_bytes()),
        Kind::U8 => binary.push(value as u8),
        Kind::I16 => binary.extend((value as i16).to_le_bytes()),
        Kind::U16 => binary.extend((value as u16).to_le_bytes()),
        Kind::I32 => binary.extend((value as i32).to_le_bytes()),
        Kind::U32 => binary.extend((value as u32).to_le_bytes()),
        Kind::F32 => binary.extend((value as f32).to_le_bytes()),
        Kind::F64 => binary.extend(value.to_le_bytes()),
    }
}
