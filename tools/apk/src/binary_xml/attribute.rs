//! What kinds of value an attribute may have.

use super::table::ATTRIBUTES;

/// Kinds of value, as bits; a reference to a resource may stand for any.
pub(crate) type Formats = u8;
pub(crate) const REFERENCE: Formats = 1 << 0;
pub(crate) const STRING: Formats = 1 << 1;
pub(crate) const INTEGER: Formats = 1 << 2;
pub(crate) const BOOLEAN: Formats = 1 << 3;
pub(crate) const COLOR: Formats = 1 << 4;
pub(crate) const FLOAT: Formats = 1 << 5;
pub(crate) const DIMENSION: Formats = 1 << 6;
pub(crate) const FRACTION: Formats = 1 << 7;

/// Names that stand for numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Symbols {
    None,
    /// One of them.
    Enum(&'static [(&'static str, u32)]),
    /// Any of them, with `|` between.
    Flags(&'static [(&'static str, u32)]),
}

/// An attribute that Android defines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attribute {
    pub(crate) name: &'static str,
    pub(crate) id: u32,
    pub(crate) formats: Formats,
    pub(crate) symbols: Symbols,
}

pub(super) const fn plain(name: &'static str, id: u32, formats: Formats) -> Attribute {
    Attribute {
        name,
        id,
        formats,
        symbols: Symbols::None,
    }
}

pub(super) const fn named(name: &'static str, id: u32, symbols: Symbols) -> Attribute {
    Attribute {
        name,
        id,
        formats: 0,
        symbols,
    }
}

/// The attribute `android:NAME`.
pub(crate) fn attribute(name: &str) -> Option<&'static Attribute> {
    ATTRIBUTES.iter().find(|one| one.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_no_name_stands_twice() {
        assert!(
            ATTRIBUTES.windows(2).all(|pair| pair[0].id < pair[1].id),
            "sorted by number"
        );
        for one in ATTRIBUTES {
            let found = attribute(one.name).expect("it is in the table");
            assert_eq!(found.id, one.id, "{}", one.name);
            assert_eq!(
                one.id >> 16,
                0x0101,
                "{}: an attribute of Android's",
                one.name
            );
        }
    }
}
