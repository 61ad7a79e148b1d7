//! FlatBuffers read in place: tables and vectors of a byte slice, every offset checked when it is followed.
//!
//! <https://flatbuffers.dev/internals/>: a table begins with the signed distance back to its table of fields' offsets (the vtable), which
//! begins with two sizes of 16 bits; a vector begins with its length of 32 bits. All numbers are little-endian.

use crate::error::ConvertError;

/// A table at a place of the file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The fields' 16-bit offsets from `at`; zero where the field is left out.
    fields: &'a [u8],
}

/// A vector of elements of `SIZE` bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vector<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Number of elements.
    pub(crate) len: usize,
}

fn cut_short() -> ConvertError {
    ConvertError::damaged("an offset leads out of the file")
}

/// `N` bytes at `at`.
fn take<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ConvertError> {
    at.checked_add(N)
        .and_then(|end| bytes.get(at..end))
        .and_then(|slice| slice.try_into().ok())
        .ok_or_else(cut_short)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<usize, ConvertError> {
    let value = u32::from_le_bytes(take(bytes, at)?);
    usize::try_from(value).map_err(|_| cut_short())
}

/// Where the unsigned offset at `at` leads to.
fn follow(bytes: &[u8], at: usize) -> Result<usize, ConvertError> {
    at.checked_add(u32_at(bytes, at)?)
        .filter(|to| *to < bytes.len())
        .ok_or_else(cut_short)
}

impl<'a> Table<'a> {
    /// The root table of a file that carries the identifier `mark` in its bytes 4 to 8.
    pub(crate) fn root(bytes: &'a [u8], mark: [u8; 4]) -> Result<Self, ConvertError> {
        if take::<4>(bytes, 4).ok() != Some(mark) {
            return Err(ConvertError::NotTflite);
        }
        Self::at(bytes, follow(bytes, 0)?)
    }

    fn at(bytes: &'a [u8], at: usize) -> Result<Self, ConvertError> {
        let back = i64::from(i32::from_le_bytes(take(bytes, at)?));
        let table = i64::try_from(at)
            .ok()
            .and_then(|at| usize::try_from(at - back).ok())
            .ok_or_else(cut_short)?;
        let size = usize::from(u16::from_le_bytes(take(bytes, table)?));
        let fields = bytes
            .get(table..)
            .and_then(|rest| rest.get(4..size))
            .ok_or_else(cut_short)?;
        Ok(Self { bytes, at, fields })
    }

    /// Where field `id` is, if it is not left out.
    fn field(&self, id: usize) -> Result<Option<usize>, ConvertError> {
        match take(self.fields, 2 * id).map(u16::from_le_bytes) {
            Err(_) | Ok(0) => Ok(None),
            Ok(offset) => self
                .at
                .checked_add(usize::from(offset))
                .filter(|at| *at < self.bytes.len())
                .map(Some)
                .ok_or_else(cut_short),
        }
    }

    /// A field of 8 bits, `default` where it is left out.
    pub(crate) fn byte(&self, id: usize, default: u8) -> Result<u8, ConvertError> {
        self.field(id)?.map_or(Ok(default), |at| {
            take::<1>(self.bytes, at).map(|[byte]| byte)
        })
    }

    /// A signed field of 32 bits, `default` where it is left out.
    pub(crate) fn int(&self, id: usize, default: i32) -> Result<i32, ConvertError> {
        self.field(id)?.map_or(Ok(default), |at| {
            take(self.bytes, at).map(i32::from_le_bytes)
        })
    }

    /// An unsigned field of 32 bits, zero where it is left out.
    pub(crate) fn index(&self, id: usize) -> Result<usize, ConvertError> {
        self.field(id)?.map_or(Ok(0), |at| u32_at(self.bytes, at))
    }

    /// An unsigned field of 64 bits, zero where it is left out.
    pub(crate) fn long(&self, id: usize) -> Result<u64, ConvertError> {
        self.field(id)?
            .map_or(Ok(0), |at| take(self.bytes, at).map(u64::from_le_bytes))
    }

    /// A field that is a table.
    pub(crate) fn table(&self, id: usize) -> Result<Option<Self>, ConvertError> {
        self.field(id)?
            .map(|at| Self::at(self.bytes, follow(self.bytes, at)?))
            .transpose()
    }

    /// A field that is a vector of elements of `size` bytes.
    fn vector(&self, id: usize, size: usize) -> Result<Option<Vector<'a>>, ConvertError> {
        let Some(at) = self.field(id)? else {
            return Ok(None);
        };
        let at = follow(self.bytes, at)?;
        let len = u32_at(self.bytes, at)?;
        let at = at + 4;
        len.checked_mul(size)
            .and_then(|length| at.checked_add(length))
            .filter(|end| *end <= self.bytes.len())
            .ok_or_else(cut_short)?;
        Ok(Some(Vector {
            bytes: self.bytes,
            at,
            len,
        }))
    }

    /// The bytes of a field that is a vector of elements of `size` bytes; empty where it is left out.
    pub(crate) fn elements(&self, id: usize, size: usize) -> Result<&'a [u8], ConvertError> {
        let vector = self.vector(id, size)?;
        Ok(vector
            .and_then(|vector| vector.bytes.get(vector.at..vector.at + size * vector.len))
            .unwrap_or(&[]))
    }

    /// The same of bytes or of a string.
    pub(crate) fn bytes(&self, id: usize) -> Result<&'a [u8], ConvertError> {
        self.elements(id, 1)
    }

    /// A field that is a vector of signed 32-bit integers, of at most `limit`.
    pub(crate) fn ints(&self, id: usize, limit: usize) -> Result<Vec<i32>, ConvertError> {
        self.vector(id, 4)?.map_or(Ok(Vec::new()), |vector| {
            bounded("integers in a list", vector.len, limit)?;
            (0..vector.len)
                .map(|k| take(vector.bytes, vector.at + 4 * k).map(i32::from_le_bytes))
                .collect()
        })
    }

    /// A field that is a vector of tables, of at most `limit`; `what` names them.
    pub(crate) fn tables(
        &self,
        id: usize,
        what: &str,
        limit: usize,
    ) -> Result<Vec<Self>, ConvertError> {
        self.vector(id, 4)?.map_or(Ok(Vec::new()), |vector| {
            bounded(what, vector.len, limit)?;
            (0..vector.len)
                .map(|k| Self::at(self.bytes, follow(vector.bytes, vector.at + 4 * k)?))
                .collect()
        })
    }
}

fn bounded(what: &str, count: usize, limit: usize) -> Result<(), ConvertError> {
    if count > limit {
        return Err(ConvertError::TooLarge {
            what: format!("{count} {what}"),
            limit,
        });
    }
    Ok(())
}
