//! Where each element's rows lie in a PLY file's binary body, checked against the body's length before anything else, and
//! reading a property out of a row.

use super::header::{Element, Header, Kind};
use crate::source::{Source, bytes_at, f32_at, u32_at};
use crate::{Format, SceneError};

/// The rows of one element, all of one length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Table<'a> {
    pub(super) element: &'a Element,
    pub(super) row_bytes: usize,
    rows: &'a [u8],
}

impl<'a> Table<'a> {
    pub(super) fn rows(&self) -> std::slice::ChunksExact<'a, u8> {
        self.rows.chunks_exact(self.row_bytes.max(1))
    }

    pub(super) fn row(&self, index: usize) -> Option<&'a [u8]> {
        let start = index.checked_mul(self.row_bytes)?;
        self.rows.get(start..)?.get(..self.row_bytes)
    }

    /// Where the named property lies in each row.
    pub(super) fn field(
        &self,
        source: &Source<'_>,
        format: Format,
        name: &str,
    ) -> Result<Field, SceneError> {
        let mut offset = 0;
        for property in &self.element.properties {
            if property.name == name {
                return Ok(Field {
                    offset,
                    kind: property.kind,
                });
            }
            offset += property.kind.bytes();
        }
        let hint = if name == "f_dc_0" {
            ": a plain cloud of points, not of Gaussians?"
        } else {
            ""
        };
        let element = &self.element.name;
        Err(source.damaged(
            format,
            format!("element `{element}` has no property `{name}`{hint}"),
        ))
    }

    pub(super) fn fields<const N: usize>(
        &self,
        source: &Source<'_>,
        format: Format,
        names: [&str; N],
    ) -> Result<[Field; N], SceneError> {
        let mut fields = [Field {
            offset: 0,
            kind: Kind::F32,
        }; N];
        for (field, name) in fields.iter_mut().zip(names) {
            *field = self.field(source, format, name)?;
        }
        Ok(fields)
    }
}

/// A property's place in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    offset: usize,
    pub(super) kind: Kind,
}

impl Field {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "whatever type a property has, a scene keeps f32"
    )]
    #[inline]
    pub(super) fn f32(self, row: &[u8]) -> f32 {
        match self.kind {
            Kind::F32 => f32_at(row, self.offset),
            Kind::F64 => f64::from_le_bytes(bytes_at(row, self.offset)) as f32,
            Kind::U8 => f32::from(bytes_at::<1>(row, self.offset)[0]),
            Kind::I8 => f32::from(i8::from_le_bytes(bytes_at(row, self.offset))),
            Kind::U16 => f32::from(u16::from_le_bytes(bytes_at(row, self.offset))),
            Kind::I16 => f32::from(i16::from_le_bytes(bytes_at(row, self.offset))),
            Kind::U32 => u32_at(row, self.offset) as f32,
            Kind::I32 => i32::from_le_bytes(bytes_at(row, self.offset)) as f32,
        }
    }

    /// The bits of a property of type `uint`, which callers have checked.
    #[inline]
    pub(super) fn u32(self, row: &[u8]) -> u32 {
        u32_at(row, self.offset)
    }

    /// The value of a property of type `uchar`, which callers have checked.
    #[inline]
    pub(super) fn u8(self, row: &[u8]) -> u8 {
        bytes_at::<1>(row, self.offset)[0]
    }
}

/// The properties that make up a Gaussian, in the order of the reader.
#[derive(Debug)]
pub(super) struct Columns {
    fields: Vec<Field>,
    /// Where each lies in a row taken as words of 32 bits, if all are `float` on such a word, as trainers write them: then
    /// no value needs a check of its type, which matters with 59 of them in each of millions of rows.
    words: Option<Vec<usize>>,
}

impl Columns {
    pub(super) fn new(
        source: &Source<'_>,
        format: Format,
        table: &Table<'_>,
        names: &[String],
    ) -> Result<Self, SceneError> {
        let fields: Vec<Field> = names
            .iter()
            .map(|name| table.field(source, format, name))
            .collect::<Result<_, _>>()?;
        let word = |field: &Field| {
            (field.kind == Kind::F32 && field.offset.is_multiple_of(4)).then_some(field.offset / 4)
        };
        let words = fields.iter().map(word).collect();
        Ok(Self { fields, words })
    }

    /// Reads the first columns into `first` and those after them into `rest`.
    #[inline]
    pub(super) fn read(&self, row: &[u8], first: &mut [f32], rest: &mut [f32]) {
        let values = first.iter_mut().chain(rest);
        if let Some(words) = &self.words {
            let (row, _) = row.as_chunks();
            for (value, &word) in values.zip(words) {
                *value = f32::from_le_bytes(row.get(word).copied().unwrap_or_default());
            }
        } else {
            for (value, field) in values.zip(&self.fields) {
                *value = field.f32(row);
            }
        }
    }
}

/// The rows of the first element of that name.
pub(super) fn table<'a>(
    source: &Source<'_>,
    format: Format,
    header: &'a Header,
    body: &'a [u8],
    name: &str,
) -> Result<Table<'a>, SceneError> {
    let mut rest = body;
    for element in &header.elements {
        let wanted = element.name == name;
        let what = || format!("element `{}` of {} rows", element.name, element.count);
        let Some(row_bytes) = element.row_bytes() else {
            if wanted {
                return Err(source.unsupported(
                    format,
                    format!("a list in element `{name}`"),
                    "write the file without it",
                ));
            }
            rest = after_lists(element, rest)
                .ok_or_else(|| source.damaged(format, format!("it ends within {}", what())))?;
            continue;
        };
        let need = element.count.saturating_mul(row_bytes as u64);
        let split = usize::try_from(need)
            .ok()
            .and_then(|need| rest.split_at_checked(need));
        let Some((rows, after)) = split else {
            return Err(source.truncated(format, what(), need, rest.len()));
        };
        if wanted {
            return Ok(Table {
                element,
                row_bytes,
                rows,
            });
        }
        rest = after;
    }
    Err(source.damaged(format, format!("it has no element `{name}`")))
}

/// What follows an element whose rows differ in length. Each row takes at least the byte of a list's count, so this ends.
fn after_lists<'a>(element: &Element, mut rest: &'a [u8]) -> Option<&'a [u8]> {
    for _ in 0..element.count {
        for property in &element.properties {
            let items = match property.list_count {
                None => 1,
                Some(kind) => {
                    let (count, after) = rest.split_at_checked(kind.bytes())?;
                    rest = after;
                    list_count(kind, count)?
                }
            };
            rest = rest.get(items.checked_mul(property.kind.bytes())?..)?;
        }
    }
    Some(rest)
}

fn list_count(kind: Kind, bytes: &[u8]) -> Option<usize> {
    match kind {
        Kind::U8 => Some(usize::from(bytes_at::<1>(bytes, 0)[0])),
        Kind::I8 => usize::try_from(i8::from_le_bytes(bytes_at(bytes, 0))).ok(),
        Kind::U16 => Some(usize::from(u16::from_le_bytes(bytes_at(bytes, 0)))),
        Kind::I16 => usize::try_from(i16::from_le_bytes(bytes_at(bytes, 0))).ok(),
        Kind::U32 => usize::try_from(u32_at(bytes, 0)).ok(),
        Kind::I32 => usize::try_from(i32::from_le_bytes(bytes_at(bytes, 0))).ok(),
        Kind::F32 | Kind::F64 => None,
    }
}
