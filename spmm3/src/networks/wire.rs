//! Protobuf's wire format, read in place.

/// Why a graph is refused, in words.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct GraphRefused(pub(super) String);

pub(super) type Checked<T> = Result<T, GraphRefused>;

pub(super) fn refuse<T>(reason: impl Into<String>) -> Checked<T> {
    Err(GraphRefused(reason.into()))
}

/// One protobuf field's content.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
    Fixed,
}

/// Walks a protobuf message's fields in place. Decoding a hostile message into structs could cost a hundred times its
/// size; walking costs nothing.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Iterator for Fields<'a> {
    type Item = Checked<(u64, Value<'a>)>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let field = read_field(&mut self.0);
        if field.is_err() {
            self.0 = &[];
        }
        Some(field)
    }
}

fn read_field<'a>(rest: &mut &'a [u8]) -> Checked<(u64, Value<'a>)> {
    let key = varint(rest)?;
    let value = match key & 7 {
        0 => Value::Number(varint(rest)?),
        1 => {
            take(rest, 8)?;
            Value::Fixed
        }
        2 => {
            let length = varint(rest)?;
            Value::Bytes(take(rest, usize::try_from(length).unwrap_or(usize::MAX))?)
        }
        5 => {
            take(rest, 4)?;
            Value::Fixed
        }
        _ => return refuse("not an ONNX file"),
    };
    Ok((key >> 3, value))
}

fn take<'a>(rest: &mut &'a [u8], length: usize) -> Checked<&'a [u8]> {
    match rest.split_at_checked(length) {
        Some((head, tail)) => {
            *rest = tail;
            Ok(head)
        }
        None => refuse("cut short"),
    }
}

pub(super) fn varint(rest: &mut &[u8]) -> Checked<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let [byte] = take(rest, 1)? else {
            return refuse("cut short");
        };
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Ok(value);
        }
    }
    refuse("not an ONNX file")
}
