//! Values as attributes and resources store them (`Res_value`): from text to type and 32 bits.

use super::attribute::{
    Attribute, BOOLEAN, COLOR, DIMENSION, FLOAT, FRACTION, Formats, INTEGER, REFERENCE, STRING,
    Symbols,
};
use super::table::FRAMEWORK;
use crate::text::unescape;

/// The number of the resource TYPE/NAME of this package.
pub(crate) type Resolve<'a> = dyn Fn(&str, &str) -> Option<u32> + 'a;

/// Type and data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Typed {
    pub(crate) kind: u8,
    pub(crate) data: u32,
}

impl Typed {
    const REFERENCE: u8 = 0x01;
    const STRING: u8 = 0x03;
    const FLOAT: u8 = 0x04;
    const DIMENSION: u8 = 0x05;
    const FRACTION: u8 = 0x06;
    const DECIMAL: u8 = 0x10;
    const HEXADECIMAL: u8 = 0x11;
    const BOOLEAN: u8 = 0x12;

    fn new(kind: u8, data: u32) -> Self {
        Self { kind, data }
    }

    /// A string by its index in the pool.
    pub(crate) fn string(index: u32) -> Self {
        Self::new(Self::STRING, index)
    }

    /// The eight bytes, in words.
    pub(crate) fn words(self) -> [u32; 2] {
        [8 | u32::from(self.kind) << 24, self.data]
    }
}

/// What a text means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    Typed(Typed),
    Text(String),
}

impl Attribute {
    /// What `text` means as this attribute's value.
    pub(crate) fn parse(&self, text: &str, resolve: &Resolve<'_>) -> Result<Value, String> {
        if let Some(id) = reference(text, resolve)? {
            return Ok(Value::Typed(id));
        }
        match self.symbols {
            Symbols::Enum(names) => symbol(text.trim(), names)
                .map(|data| Value::Typed(Typed::new(Typed::DECIMAL, data))),
            Symbols::Flags(names) => text
                .split('|')
                .try_fold(0, |all, one| {
                    symbol(one.trim(), names).map(|flag| all | flag)
                })
                .map(|data| Value::Typed(Typed::new(Typed::HEXADECIMAL, data))),
            Symbols::None => parse_plain(text, self.formats),
        }
    }
}

fn symbol(name: &str, names: &[(&str, u32)]) -> Result<u32, String> {
    names
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, value)| *value)
        .ok_or_else(|| {
            let known: Vec<&str> = names.iter().map(|(known, _)| *known).collect();
            format!("{name:?} is none of {}", known.join(", "))
        })
}

/// What a text that is no reference means, where it may be of `formats`. In the order that Android's packager tries them.
pub(crate) fn parse_plain(text: &str, formats: Formats) -> Result<Value, String> {
    let trimmed = text.trim();
    let may = |format: Formats| formats & format != 0;
    if may(COLOR) && trimmed.starts_with('#') {
        match color(trimmed) {
            Some(color) => return Ok(Value::Typed(color)),
            None if !may(STRING) => {
                return Err(format!(
                    "{trimmed:?} is no colour: #RGB, #ARGB, #RRGGBB or #AARRGGBB"
                ));
            }
            None => {}
        }
    }
    if may(BOOLEAN) {
        match trimmed {
            "true" | "TRUE" | "True" => {
                return Ok(Value::Typed(Typed::new(Typed::BOOLEAN, u32::MAX)));
            }
            "false" | "FALSE" | "False" => return Ok(Value::Typed(Typed::new(Typed::BOOLEAN, 0))),
            _ => {}
        }
    }
    let number = may(INTEGER).then(|| integer(trimmed)).flatten();
    let number = number.or_else(|| may(FLOAT).then(|| float(trimmed)).flatten());
    let number = number.or_else(|| {
        may(DIMENSION)
            .then(|| measure(trimmed, &UNITS, Typed::DIMENSION))
            .flatten()
    });
    let number = number.or_else(|| {
        may(FRACTION)
            .then(|| measure(trimmed, &FRACTIONS, Typed::FRACTION))
            .flatten()
    });
    if let Some(number) = number {
        return Ok(Value::Typed(number));
    }
    if may(STRING) {
        return unescape(text).map(Value::Text);
    }
    Err(format!("{text:?} is no {}", describe(formats)))
}

fn describe(formats: Formats) -> String {
    let names: Vec<&str> = [
        (INTEGER, "integer of 32 bits"),
        (BOOLEAN, "boolean (true or false)"),
        (COLOR, "colour (#RRGGBB)"),
        (FLOAT, "number"),
        (DIMENSION, "dimension (12dp)"),
        (FRACTION, "fraction (50%)"),
        (REFERENCE, "reference to a resource (@type/name)"),
    ]
    .into_iter()
    .filter(|(format, _)| formats & format != 0)
    .map(|(_, name)| name)
    .collect();
    names.join(" or ")
}

/// The resource that `@type/name` is, or `@android:type/name`; nothing for any other text.
pub(crate) fn reference(text: &str, resolve: &Resolve<'_>) -> Result<Option<Typed>, String> {
    let trimmed = text.trim();
    if trimmed.starts_with('?') {
        return Err(format!(
            r"{trimmed:?} refers to a theme, and this packager writes none; a question mark that is meant is written \?"
        ));
    }
    let Some(name) = trimmed.strip_prefix('@') else {
        return Ok(None);
    };
    let id = match name.strip_prefix("android:") {
        Some(name) => FRAMEWORK
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, id)| *id),
        None => name
            .split_once('/')
            .and_then(|(kind, name)| resolve(kind, name)),
    };
    match id {
        Some(id) => Ok(Some(Typed::new(Typed::REFERENCE, id))),
        None => Err(format!(
            "there is no resource {trimmed}; an at sign that is meant is written \\@"
        )),
    }
}

fn integer(text: &str) -> Option<Typed> {
    if let Some(digits) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        if !digits.bytes().all(|one| one.is_ascii_hexdigit()) {
            return None;
        }
        return u32::from_str_radix(digits, 16)
            .ok()
            .map(|data| Typed::new(Typed::HEXADECIMAL, data));
    }
    if text.starts_with('+') {
        return None;
    }
    text.parse::<i32>()
        .ok()
        .map(|value| Typed::new(Typed::DECIMAL, value.cast_unsigned()))
}

/// Digits, as C writes numbers: no `inf`, no `nan`.
fn finite(text: &str) -> Option<f32> {
    if !text
        .bytes()
        .all(|one| one.is_ascii_digit() || matches!(one, b'.' | b'-' | b'+' | b'e' | b'E'))
    {
        return None;
    }
    text.parse::<f32>().ok().filter(|value| value.is_finite())
}

fn float(text: &str) -> Option<Typed> {
    finite(text).map(|value| Typed::new(Typed::FLOAT, value.to_bits()))
}

fn color(text: &str) -> Option<Typed> {
    let digits = text.strip_prefix('#')?;
    if !digits.bytes().all(|one| one.is_ascii_hexdigit()) {
        return None;
    }
    let value = u32::from_str_radix(digits, 16).ok()?;
    // Every digit twice.
    let doubled = (0..4).fold(0, |all, one| {
        all | ((((value >> (4 * one)) & 0xf) * 0x11) << (8 * one))
    });
    match digits.len() {
        3 => Some(Typed::new(0x1f, 0xff00_0000 | doubled)),
        4 => Some(Typed::new(0x1e, doubled)),
        6 => Some(Typed::new(0x1d, 0xff00_0000 | value)),
        8 => Some(Typed::new(0x1c, value)),
        _ => None,
    }
}

/// Suffix, number of the unit, factor.
const UNITS: [(&str, u32, f32); 7] = [
    ("px", 0, 1.0),
    ("dip", 1, 1.0),
    ("dp", 1, 1.0),
    ("sp", 2, 1.0),
    ("pt", 3, 1.0),
    ("in", 4, 1.0),
    ("mm", 5, 1.0),
];
const FRACTIONS: [(&str, u32, f32); 2] = [("%p", 1, 0.01), ("%", 0, 0.01)];

/// A number with a unit, in 24 bits of which 0, 7, 15 or 23 are behind the point: as many as its whole part leaves.
fn measure(text: &str, units: &[(&str, u32, f32)], kind: u8) -> Option<Typed> {
    let (digits, unit, factor) = units
        .iter()
        .find_map(|(suffix, unit, factor)| Some((text.strip_suffix(suffix)?, *unit, *factor)))?;
    let value = f64::from(finite(digits)? * factor);
    let fixed = (value.abs() * f64::from(1 << 23) + 0.5).floor();
    if fixed >= f64::from(1_u32 << 23) * f64::from(1 << 23) {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, not negative, and below 2^46"
    )]
    let bits = fixed as u64;
    let (radix, shift) = match bits {
        bits if bits & 0x7f_ffff == 0 => (0, 23),
        bits if bits < 1 << 23 => (3, 0),
        bits if bits < 1 << 31 => (2, 8),
        bits if bits < 1 << 39 => (1, 16),
        _ => (0, 23),
    };
    let magnitude = u32::try_from((bits >> shift) & 0xff_ffff).ok()?;
    let mantissa = if value < 0.0 {
        magnitude.wrapping_neg() & 0xff_ffff
    } else {
        magnitude
    };
    Some(Typed::new(kind, mantissa << 8 | radix << 4 | unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binary_xml::attribute::attribute;

    fn parse(name: &str, text: &str) -> Result<Value, String> {
        let known =
            |kind: &str, name: &str| (kind == "string" && name == "a").then_some(0x7f01_0000);
        attribute(name)
            .expect("a known attribute")
            .parse(text, &known)
    }

    fn typed(kind: u8, data: u32) -> Result<Value, String> {
        Ok(Value::Typed(Typed { kind, data }))
    }

    #[test]
    fn texts_become_the_types_that_androids_packager_gives_them() {
        assert_eq!(parse("versionCode", "17"), typed(0x10, 17));
        assert_eq!(parse("versionCode", "-1"), typed(0x10, u32::MAX));
        assert_eq!(parse("glEsVersion", "0x00030001"), typed(0x11, 0x30001));
        assert_eq!(parse("exported", "true"), typed(0x12, u32::MAX));
        assert_eq!(parse("exported", "False"), typed(0x12, 0));
        assert_eq!(parse("launchMode", "singleTask"), typed(0x10, 2));
        assert_eq!(
            parse("screenOrientation", "unspecified"),
            typed(0x10, u32::MAX)
        );
        assert_eq!(
            parse("configChanges", "density | keyboard"),
            typed(0x11, 0x1010)
        );
        assert_eq!(parse("label", "@string/a"), typed(0x01, 0x7f01_0000));
        assert_eq!(
            parse("theme", "@android:style/Theme.Black.NoTitleBar.Fullscreen"),
            typed(0x01, 0x0103_000a)
        );
        assert_eq!(parse("minSdkVersion", "29"), typed(0x10, 29));
        assert_eq!(parse("minSdkVersion", "Q"), Ok(Value::Text("Q".into())));
        assert_eq!(parse("value", "1.5"), typed(0x04, 1.5_f32.to_bits()));
        assert_eq!(parse("value", "#f80"), typed(0x1f, 0xffff_8800));
        assert_eq!(parse("value", "#8f80"), typed(0x1e, 0x88ff_8800));
        assert_eq!(parse("value", "#12ab34"), typed(0x1d, 0xff12_ab34));
        assert_eq!(parse("value", "#7f12ab34"), typed(0x1c, 0x7f12_ab34));
        assert_eq!(
            parse("value", "quest3|quest2"),
            Ok(Value::Text("quest3|quest2".into()))
        );
        assert_eq!(parse("value", r"\@home"), Ok(Value::Text("@home".into())));
        assert_eq!(parse("value", "nan"), Ok(Value::Text("nan".into())));
        assert_eq!(
            parse("value", "99999999999"),
            typed(0x04, 99_999_999_999.0_f32.to_bits())
        );
    }

    #[test]
    fn a_dimension_keeps_its_unit_and_as_many_places_as_fit() {
        // Checked by hand against the format: mantissa, radix, unit.
        assert_eq!(parse("width", "108dp"), typed(0x05, 108 << 8 | 1));
        assert_eq!(parse("width", "-3px"), typed(0x05, 0xff_fffd << 8));
        assert_eq!(
            parse("width", "0.5in"),
            typed(0x05, 0x40_0000 << 8 | 3 << 4 | 4)
        );
        assert_eq!(
            parse("width", "1.5mm"),
            typed(0x05, 0xc000 << 8 | 2 << 4 | 5)
        );
        assert_eq!(
            parse("width", "300.5sp"),
            typed(0x05, 0x9640 << 8 | 1 << 4 | 2)
        );
        assert_eq!(parse("inset", "25%"), typed(0x06, 0x20_0000 << 8 | 3 << 4));
        assert_eq!(
            parse("inset", "50%p"),
            typed(0x06, 0x40_0000 << 8 | 3 << 4 | 1)
        );
        assert!(
            parse("width", "9000000dp").is_err(),
            "24 bits do not hold it"
        );
    }

    #[test]
    fn a_value_of_the_wrong_kind_is_refused() {
        for (name, text, why) in [
            ("versionCode", "one", "no integer"),
            ("versionCode", "4294967296", "no integer"),
            ("versionCode", "0x", "no integer"),
            ("versionCode", "0x+1", "no integer"),
            ("exported", "yes", "true or false"),
            ("launchMode", "2", "none of standard, singleTop"),
            ("configChanges", "density|", "\"\" is none of"),
            ("configChanges", "dense", "none of mcc"),
            ("label", "@string/b", "no resource @string/b"),
            ("label", "@string", "no resource @string"),
            ("label", "@", "no resource @"),
            ("theme", "@android:style/Nothing", "no resource"),
            ("theme", "?attr/x", "theme"),
            ("icon", "icon.png", "reference to a resource"),
            ("fillColor", "#12", "no colour"),
            ("fillColor", "#+12", "no colour"),
            ("viewportWidth", "inf", "no number"),
            ("width", "12", "no dimension"),
            ("value", r"a\q", "stands for nothing"),
        ] {
            let error = parse(name, text).expect_err(text);
            assert!(
                error.contains(why),
                "{name}={text:?}: {error} should speak of {why}"
            );
        }
    }
}
