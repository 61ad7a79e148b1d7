//! FlexBuffers read in place: the map of numbers and of lists of integers that a custom operator's settings are.
//!
//! <https://flatbuffers.dev/internals/#flexbuffers>: the last bytes are the root, its packed type and its width. The packed type holds
//! the kind in its upper six bits and the width of the elements, as a power of two, in the lower two. What does not fit inside a value's
//! width lies at an offset backwards. The crate `flexbuffers` indexes its buffer unchecked in places, so that a damaged file ends it.

use crate::error::ConvertError;

const INT: u8 = 1;
const UINT: u8 = 2;
const FLOAT: u8 = 3;
const MAP: u8 = 9;
const VECTOR: u8 = 10;
const VECTOR_INT: u8 = 11;
const VECTOR_UINT: u8 = 12;

/// Most entries of a map or list.
const MAX_ENTRIES: usize = 1 << 12;

fn damaged() -> ConvertError {
    ConvertError::damaged("a custom operator's settings cannot be read")
}

/// A map whose keys are in order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Map<'a> {
    bytes: &'a [u8],
    at: usize,
    width: usize,
    keys: usize,
    keys_width: usize,
    len: usize,
}

/// A value: where it is stored, how wide that is, and its packed type.
#[derive(Debug, Clone, Copy)]
struct Value<'a> {
    bytes: &'a [u8],
    at: usize,
    width: usize,
    packed: u8,
}

/// The `width` bytes at `at`, widened to eight.
fn raw(bytes: &[u8], at: usize, width: usize) -> Result<[u8; 8], ConvertError> {
    let slice = at
        .checked_add(width)
        .and_then(|end| bytes.get(at..end))
        .ok_or_else(damaged)?;
    let mut wide = [0; 8];
    wide.get_mut(..width)
        .ok_or_else(damaged)?
        .copy_from_slice(slice);
    Ok(wide)
}

fn unsigned(bytes: &[u8], at: usize, width: usize) -> Result<usize, ConvertError> {
    usize::try_from(u64::from_le_bytes(raw(bytes, at, width)?)).map_err(|_| damaged())
}

/// Where the offset backwards at `at` leads to.
fn follow(bytes: &[u8], at: usize, width: usize) -> Result<usize, ConvertError> {
    at.checked_sub(unsigned(bytes, at, width)?)
        .ok_or_else(damaged)
}

/// The number of entries, which stands before a vector's first.
fn length(bytes: &[u8], at: usize, width: usize) -> Result<usize, ConvertError> {
    unsigned(bytes, at.checked_sub(width).ok_or_else(damaged)?, width)
        .ok()
        .filter(|len| *len <= MAX_ENTRIES)
        .ok_or_else(damaged)
}

impl<'a> Map<'a> {
    /// The map that is the root of `bytes`.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, ConvertError> {
        let [.., packed, width] = *bytes else {
            return Err(damaged());
        };
        let root = usize::from(width);
        if !matches!(root, 1 | 2 | 4 | 8) || packed >> 2 != MAP {
            return Err(damaged());
        }
        let slot = (bytes.len() - 2).checked_sub(root).ok_or_else(damaged)?;
        let at = follow(bytes, slot, root)?;
        let width = 1 << (packed & 3);
        // Before the values: the offset to the keys, the width of the keys' offsets, the length.
        let head = at.checked_sub(3 * width).ok_or_else(damaged)?;
        let keys_width = unsigned(bytes, head + width, width)?;
        if !matches!(keys_width, 1 | 2 | 4 | 8) {
            return Err(damaged());
        }
        Ok(Self {
            bytes,
            at,
            width,
            keys: follow(bytes, head, width)?,
            keys_width,
            len: length(bytes, at, width)?,
        })
    }

    fn get(&self, name: &str) -> Result<Value<'a>, ConvertError> {
        for k in 0..self.len {
            let key = follow(self.bytes, self.keys + k * self.keys_width, self.keys_width)?;
            let text = self.bytes.get(key..).unwrap_or(&[]);
            if text
                .strip_prefix(name.as_bytes())
                .is_some_and(|rest| rest.first() == Some(&0))
            {
                let types = self.at + self.len * self.width;
                return Ok(Value {
                    bytes: self.bytes,
                    at: self.at + k * self.width,
                    width: self.width,
                    packed: *self.bytes.get(types + k).ok_or_else(damaged)?,
                });
            }
        }
        Err(ConvertError::damaged(format!(
            "a custom operator lacks its setting {name}"
        )))
    }

    /// The number `name`.
    pub(crate) fn number(&self, name: &str) -> Result<f64, ConvertError> {
        self.get(name)?.number()
    }

    /// The integer `name`, which is not negative.
    pub(crate) fn integer(&self, name: &str) -> Result<i64, ConvertError> {
        self.get(name)?.integer()
    }

    /// The list `name` of integers that are not negative.
    pub(crate) fn integers(&self, name: &str) -> Result<Vec<i64>, ConvertError> {
        self.get(name)?.integers()
    }
}

impl Value<'_> {
    fn number(self) -> Result<f64, ConvertError> {
        let bytes = raw(self.bytes, self.at, self.width)?;
        let [a, b, c, d, ..] = bytes;
        match (self.packed >> 2, self.width) {
            (FLOAT, 8) => Ok(f64::from_le_bytes(bytes)),
            (FLOAT, 4) => Ok(f32::from_le_bytes([a, b, c, d]).into()),
            (INT | UINT, _) => self.integer().map(|value| value as f64),
            _ => Err(damaged()),
        }
    }

    fn integer(self) -> Result<i64, ConvertError> {
        let value = unsigned(self.bytes, self.at, self.width)?;
        // A set uppermost bit is a negative number of kind INT.
        let negative = self.packed >> 2 == INT && value >> (8 * self.width - 1) != 0;
        i64::try_from(value)
            .ok()
            .filter(|_| matches!(self.packed >> 2, INT | UINT) && !negative)
            .ok_or_else(damaged)
    }

    fn integers(self) -> Result<Vec<i64>, ConvertError> {
        let at = follow(self.bytes, self.at, self.width)?;
        let width = 1 << (self.packed & 3);
        let len = length(self.bytes, at, width)?;
        (0..len)
            .map(|k| {
                let packed = match self.packed >> 2 {
                    VECTOR_INT => INT << 2,
                    VECTOR_UINT => UINT << 2,
                    VECTOR => *self.bytes.get(at + len * width + k).ok_or_else(damaged)?,
                    _ => return Err(damaged()),
                };
                let value = Self {
                    bytes: self.bytes,
                    at: at + k * width,
                    width,
                    packed,
                };
                value.integer()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by Google's own writer (Python's flatbuffers 25.12.19): {"any": [1, 2, 70000], "neg": -3, "output_width": 16, "scale_x":
    /// 1.5, "subset_idxs": [61, 146, 300]}, the last a list of one type, the first one of any.
    #[rustfmt::skip]
    const SETTINGS: [u8; 120] = [
        111, 117, 116, 112, 117, 116, 95, 119, 105, 100, 116, 104, 0, 115, 99, 97, 108, 101, 95, 120, 0, 115, 117, 98,
        115, 101, 116, 95, 105, 100, 120, 115, 0, 0, 3, 0, 61, 0, 146, 0, 44, 1, 110, 101, 103, 0, 97, 110, 121, 0, 0,
        0, 3, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 112, 17, 1, 0, 6, 6, 6, 5, 26, 31, 74, 62, 55, 0, 0, 0, 8, 0, 0, 0, 1, 0,
        0, 0, 5, 0, 0, 0, 36, 0, 0, 0, 253, 255, 255, 255, 16, 0, 0, 0, 0, 0, 192, 63, 72, 0, 0, 0, 42, 6, 6, 14, 45,
        25, 38, 1,
    ];

    #[test]
    fn what_googles_writer_wrote_is_read() {
        let map = Map::read(&SETTINGS).unwrap();
        assert_eq!(map.integers("any"), Ok(vec![1, 2, 70000]), "any types");
        assert_eq!(
            map.integers("subset_idxs"),
            Ok(vec![61, 146, 300]),
            "one type"
        );
        assert_eq!(map.integer("output_width"), Ok(16), "an integer");
        assert_eq!(
            map.number("output_width"),
            Ok(16.0),
            "an integer as a number"
        );
        assert_eq!(map.number("scale_x"), Ok(1.5), "a number");
        assert!(map.integer("neg").is_err(), "a negative one");
        assert!(map.integer("scale_x").is_err(), "a fraction");
        assert!(map.integer("scale").is_err(), "part of a name");
        assert!(map.integers("neg").is_err(), "no list");
    }

    #[test]
    fn damaged_settings_are_read_or_refused() {
        let all = |bytes: &[u8]| {
            if let Ok(map) = Map::read(bytes) {
                for name in ["any", "neg", "output_width", "scale_x", "subset_idxs"] {
                    let _ = (map.integer(name), map.number(name), map.integers(name));
                }
            }
        };
        for length in 0..SETTINGS.len() {
            all(&SETTINGS[..length]);
        }
        for place in 0..SETTINGS.len() {
            for value in 0..=255 {
                let mut damaged = SETTINGS;
                damaged[place] = value;
                all(&damaged);
            }
        }
    }
}
