//! The header of a PLY file: what elements follow, how often, and of what properties. Nothing is allocated by what it
//! promises.

use crate::source::Source;
use crate::{Format, SceneError};

/// A longer header is refused; 3DGS writes 1.5 KB.
const MAX_HEADER_BYTES: usize = 1 << 20;
const MAX_ELEMENTS: usize = 64;
const MAX_PROPERTIES: usize = 1024;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    LittleEndian,
    Ascii,
}

/// A number's type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    /// The type of the count before the items where the property is a list.
    pub(super) list_count: Option<Kind>,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    pub(super) fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|property| property.name == name)
    }

    /// Bytes of one row, unless a list makes rows differ.
    pub(super) fn row_bytes(&self) -> Option<usize> {
        self.properties
            .iter()
            .map(|property| property.list_count.is_none().then(|| property.kind.bytes()))
            .sum()
    }

    /// Properties named `f_rest_0`, `f_rest_1` and so on without a gap.
    pub(super) fn rest_properties(&self) -> usize {
        (0..self.properties.len())
            .take_while(|index| self.has(&format!("f_rest_{index}")))
            .count()
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

impl Header {
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }

    /// The header and the body after it.
    pub(super) fn parse<'a>(source: &Source<'a>) -> Result<(Self, &'a [u8]), SceneError> {
        let damaged = |what: String| source.damaged(Format::Ply, what);
        let mut rest = source.bytes;
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let used = source.bytes.len() - rest.len();
            let room = MAX_HEADER_BYTES.saturating_sub(used).min(rest.len());
            let window = rest.get(..room).unwrap_or_default();
            let Some(end) = window.iter().position(|&byte| byte == b'\n') else {
                return Err(damaged(format!(
                    "its header has no line `end_header` in the first {MAX_HEADER_BYTES} bytes"
                )));
            };
            let (line, after) = rest.split_at_checked(end + 1).unwrap_or((rest, &[]));
            rest = after;
            let line = String::from_utf8_lossy(line);
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                [] | ["ply"] | ["comment" | "obj_info", ..] => {}
                ["end_header"] => break,
                ["format", "binary_little_endian", _] => encoding = Some(Encoding::LittleEndian),
                ["format", "ascii", _] => encoding = Some(Encoding::Ascii),
                ["format", other, ..] => {
                    return Err(source.unsupported(
                        Format::Ply,
                        format!("the encoding {}", other.escape_debug()),
                        "write the file as binary_little_endian",
                    ));
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| {
                        damaged(format!(
                            "element `{}` has the count `{}`",
                            name.escape_debug(),
                            count.escape_debug()
                        ))
                    })?;
                    if elements.len() == MAX_ELEMENTS {
                        return Err(damaged(format!("it has more than {MAX_ELEMENTS} elements")));
                    }
                    elements.push(Element {
                        // It may be printed.
                        name: name.escape_debug().to_string(),
                        count,
                        properties: Vec::new(),
                    });
                }
                ["property", words @ ..] => {
                    let property = property(words).ok_or_else(|| {
                        damaged(format!(
                            "its header has the line `{}`",
                            line.trim().escape_debug()
                        ))
                    })?;
                    let Some(element) = elements.last_mut() else {
                        return Err(damaged(
                            "a property comes before the first element".to_owned(),
                        ));
                    };
                    if element.properties.len() == MAX_PROPERTIES {
                        return Err(damaged(format!(
                            "element `{}` has more than {MAX_PROPERTIES} properties",
                            element.name
                        )));
                    }
                    element.properties.push(property);
                }
                _ => {
                    let shown: String = line.trim().chars().take(60).collect();
                    return Err(damaged(format!("its header has the line `{shown}`")));
                }
            }
        }
        let encoding =
            encoding.ok_or_else(|| damaged("its header has no line `format`".to_owned()))?;
        Ok((Self { encoding, elements }, rest))
    }
}

fn property(words: &[&str]) -> Option<Property> {
    let (list_count, kind, name) = match words {
        ["list", count, kind, name] => (Some(Kind::parse(count)?), kind, name),
        [kind, name] => (None, kind, name),
        _ => return None,
    };
    Some(Property {
        name: (*name).to_owned(),
        list_count,
        kind: Kind::parse(kind)?,
    })
}
