//! NumPy arrays inside an `.npz` archive: what motion files, and captures' poses, are.
//!
//! Written here on purpose: the crates for it parse the header's Python literal recursively, so that a
//! hostile header of nested brackets overflows the stack, and bring an arbitrary-precision integer and a grammar engine.
//! Here a header is three known keys, and no byte is read beyond what shape and type account for.

use super::{MAX_FRAMES, MotionError, narrow, printable};
use crate::JOINTS;
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// Numbers in the largest array: the longest clip's poses. Counted after reading, in single precision, whatever their
/// size in the file.
const MAX_VALUES: usize = MAX_FRAMES * 3 * JOINTS;
const MAX_HEADER: usize = 64 << 10;
/// Characters of the longest string.
const MAX_TEXT: usize = 256;

/// An array of numbers, row-major whatever its order in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct NpzArray {
    /// Its sizes, the outermost first; none for a single number.
    pub shape: Vec<usize>,
    /// All finite, in single precision whatever they are in the file.
    pub values: Vec<f32>,
    /// Numbers per frame: those of all dimensions but the first, or of the only one.
    width: usize,
}

impl NpzArray {
    /// Rows of a [F, ...] array, or the one row of a flat array; `width` numbers each.
    ///
    /// # Errors
    /// [`MotionError::Array`] with `name` if a row has another width.
    pub fn rows(&self, name: &str, width: usize) -> Result<&[f32], MotionError> {
        let fits = !self.shape.is_empty() && self.width == width;
        if fits && (self.shape.len() >= 2 || width > 0) {
            Ok(&self.values)
        } else {
            Err(MotionError::array(
                name,
                format!(
                    "has shape {:?} where [frames, {width}] is needed",
                    self.shape
                ),
            ))
        }
    }

    /// Numbers per frame: those of all dimensions but the first, or of the only one.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }
}

/// An `.npz` held in memory.
#[derive(Debug)]
pub struct Npz<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
}

impl<'a> Npz<'a> {
    /// Reads the archive's directory.
    ///
    /// # Errors
    /// [`MotionError::Archive`] if it is no zip.
    pub fn open(bytes: &'a [u8]) -> Result<Self, MotionError> {
        Ok(Self {
            archive: ZipArchive::new(Cursor::new(bytes))?,
        })
    }

    /// Names of the arrays, printable.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.archive
            .file_names()
            .filter_map(|name| Some(printable(name.ok()?.strip_suffix(".npy")?)))
            .collect()
    }

    /// Reads one array of numbers; `None` if the archive has none of that name.
    ///
    /// # Errors
    /// [`MotionError::Array`] if it is damaged, no array of numbers, too large, or has a number that is not finite.
    pub fn array(&mut self, name: &str) -> Result<Option<NpzArray>, MotionError> {
        let member = format!("{name}.npy");
        if self.archive.index_for_name(&member).is_none() {
            return Ok(None);
        }
        let mut file = self.archive.by_name(&member)?;
        read_array(name, &mut file).map(Some)
    }

    /// Reads one array of one string (`<U10` or `|S10` and the like); `None` if the archive has none of that name.
    ///
    /// # Errors
    /// [`MotionError::Array`] if it is damaged or no single short string.
    pub fn text(&mut self, name: &str) -> Result<Option<String>, MotionError> {
        let member = format!("{name}.npy");
        if self.archive.index_for_name(&member).is_none() {
            return Ok(None);
        }
        let mut file = self.archive.by_name(&member)?;
        read_text(name, &mut file).map(Some)
    }
}

/// Three keys of an array's header, as written.
struct Header {
    kind: String,
    fortran: bool,
    shape: Vec<usize>,
}

fn read_header(name: &str, file: &mut impl Read) -> Result<Header, MotionError> {
    let fail = |reason: String| MotionError::array(name, reason);
    let damaged = |e: std::io::Error| MotionError::array(name, format!("cannot be read: {e}"));
    let mut start = [0; 8];
    file.read_exact(&mut start).map_err(damaged)?;
    let [magic @ .., major, _minor] = start;
    if magic != *b"\x93NUMPY" {
        return Err(fail("is not a NumPy array".to_owned()));
    }
    let length = if major == 1 {
        let mut length = [0; 2];
        file.read_exact(&mut length).map_err(damaged)?;
        usize::from(u16::from_le_bytes(length))
    } else {
        let mut length = [0; 4];
        file.read_exact(&mut length).map_err(damaged)?;
        usize::try_from(u32::from_le_bytes(length)).unwrap_or(usize::MAX)
    };
    if length > MAX_HEADER {
        return Err(fail(format!("has a header of {length} bytes")));
    }
    let mut header = vec![0; length];
    file.read_exact(&mut header).map_err(damaged)?;
    let header = String::from_utf8_lossy(&header).into_owned();
    let field = |key: &str| {
        field(&header, key)
            .ok_or_else(|| MotionError::array(name, format!("has no `{key}` in its header")))
    };
    let kind = field("descr")?;
    let kind = kind
        .strip_prefix(['\'', '"'])
        .and_then(|k| k.split(['\'', '"']).next())
        .ok_or_else(|| fail("holds records or objects, not numbers".to_owned()))?;
    Ok(Header {
        kind: printable(kind),
        fortran: field("fortran_order")?.starts_with("True"),
        shape: shape(field("shape")?)
            .ok_or_else(|| fail("has an unreadable shape in its header".to_owned()))?,
    })
}

fn read_text(name: &str, file: &mut impl Read) -> Result<String, MotionError> {
    let fail = |reason: String| MotionError::array(name, reason);
    let header = read_header(name, file)?;
    let kind = header.kind.as_str();
    let length = |letter: char| -> Option<usize> {
        let digits = kind.strip_prefix(['<', '>', '|', '='])?;
        digits.strip_prefix(letter)?.parse().ok()
    };
    let one = header.shape.iter().all(|d| *d == 1);
    let (characters, bytes) = match (length('U'), length('S')) {
        (Some(characters), _) => (characters, 4),
        (None, Some(characters)) => (characters, 1),
        (None, None) => (0, 0),
    };
    if !one || !(1..=MAX_TEXT).contains(&characters) {
        return Err(fail(format!(
            "has type {kind:.20} and shape {:?} where one string of at most {MAX_TEXT} characters is needed",
            header.shape
        )));
    }
    let mut data = vec![0; characters * bytes];
    file.read_exact(&mut data)
        .map_err(|e| MotionError::array(name, format!("cannot be read: {e}")))?;
    let code = |chunk: &[u8]| match *chunk {
        [a, b, c, d] if kind.starts_with('>') => u32::from_be_bytes([a, b, c, d]),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        [a] => u32::from(a),
        _ => 0,
    };
    // NumPy fills strings up with zeros.
    Ok(data
        .chunks_exact(bytes)
        .map(code)
        .take_while(|code| *code != 0)
        .map(|code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect())
}

fn read_array(name: &str, file: &mut impl Read) -> Result<NpzArray, MotionError> {
    let fail = |reason: String| MotionError::array(name, reason);
    let damaged = |e: std::io::Error| MotionError::array(name, format!("cannot be read: {e}"));
    let Header {
        kind,
        fortran,
        shape,
    } = read_header(name, file)?;
    let element = Element::of(&kind).ok_or_else(|| {
        fail(format!(
            "has type {kind:.20} where floating point or integer numbers are needed"
        ))
    })?;
    let product = |dims: &[usize]| dims.iter().try_fold(1usize, |n, d| n.checked_mul(*d));
    let width = match shape.as_slice() {
        [flat] => Some(*flat),
        [] => Some(1),
        [_, inner @ ..] => product(inner),
    };
    // No frames of absurd width are absurd as well, although they hold nothing.
    let (width, count) = width
        .zip(product(&shape))
        .filter(|(width, count)| *width.max(count) <= MAX_VALUES)
        .ok_or_else(|| {
            fail(format!(
                "of shape {shape:?} is larger than the longest clip this reads"
            ))
        })?;
    let bytes = count * element.bytes;
    // `take` grows the buffer with what is really there; the claimed size is only compared afterwards.
    let mut data = Vec::new();
    file.take(bytes as u64)
        .read_to_end(&mut data)
        .map_err(damaged)?;
    if data.len() != bytes {
        return Err(fail(format!(
            "holds {} bytes where shape {shape:?} needs {bytes}",
            data.len()
        )));
    }
    let values: Vec<f32> = data
        .chunks_exact(element.bytes)
        .map(|chunk| element.read(chunk))
        .collect();
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(fail(format!(
            "has a value at place {at} that is not a finite number"
        )));
    }
    let values = if fortran && shape.len() > 1 {
        row_major(&values, &shape)
    } else {
        values
    };
    Ok(NpzArray {
        shape,
        values,
        width,
    })
}

/// Type of an array's numbers.
#[derive(Debug, Clone, Copy)]
struct Element {
    bytes: usize,
    float: bool,
    big_endian: bool,
}

impl Element {
    fn of(kind: &str) -> Option<Self> {
        let (order, rest) = kind.split_at_checked(1)?;
        let (float, bytes) = match rest {
            "f2" => (true, 2),
            "f4" => (true, 4),
            "f8" => (true, 8),
            "i2" => (false, 2),
            "i4" => (false, 4),
            "i8" => (false, 8),
            _ => return None,
        };
        matches!(order, "<" | ">" | "=" | "|").then_some(Self {
            bytes,
            float,
            big_endian: order == ">",
        })
    }

    fn read(self, chunk: &[u8]) -> f32 {
        let mut wide = [0; 8];
        for (to, from) in wide.iter_mut().zip(chunk) {
            *to = *from;
        }
        if self.big_endian {
            wide[..self.bytes.min(8)].reverse();
        }
        let [a, b, c, d, ..] = wide;
        match (self.float, self.bytes) {
            (true, 2) => half::f16::from_le_bytes([a, b]).to_f32(),
            (true, 4) => f32::from_le_bytes([a, b, c, d]),
            (true, _) => narrow(f64::from_le_bytes(wide)),
            (false, 2) => f32::from(i16::from_le_bytes([a, b])),
            (false, 4) => narrow(f64::from(i32::from_le_bytes([a, b, c, d]))),
            (false, _) => i64::from_le_bytes(wide) as f32,
        }
    }
}

/// The text after `'key':`.
fn field<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header
        .split_once(&format!("'{key}'"))
        .or_else(|| header.split_once(&format!("\"{key}\"")))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

fn shape(text: &str) -> Option<Vec<usize>> {
    let (inside, _) = text.strip_prefix('(')?.split_once(')')?;
    inside
        .split(',')
        .map(str::trim)
        .filter(|d| !d.is_empty())
        .map(|d| d.trim_end_matches('L').parse().ok())
        .collect::<Option<Vec<usize>>>()
        .filter(|shape| shape.len() <= 4)
}

/// Column-major to row-major.
fn row_major(values: &[f32], shape: &[usize]) -> Vec<f32> {
    let mut at = vec![0; shape.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let (index, _) = at
            .iter()
            .zip(shape)
            .fold((0, 1), |(index, stride), (i, d)| {
                (index + i * stride, stride * d)
            });
        out.push(values[index]);
        for (i, d) in at.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < *d {
                break;
            }
            *i = 0;
        }
    }
    out
}
