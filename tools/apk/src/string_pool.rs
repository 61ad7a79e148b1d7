//! Pools of strings (`ResStringPool`): in binary XML and resource tables every string is an index into one.

use std::collections::HashMap;

use crate::chunk::{HEADER, chunk, kind, size, words};

/// What a length of UTF-8's two units may be, in UTF-16 units and in bytes.
const LONGEST_UTF8: usize = 0x7fff;
const UTF8_FLAG: u32 = 1 << 8;

/// How the strings are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// In UTF-8, where all of them can be: no more than 32767 units, and no character beyond 16 bits, about whose bytes versions of
    /// Android differ.
    Utf8,
    /// As Android's own packager stores manifests.
    Utf16,
}

/// Strings by index.
#[derive(Debug, Default)]
pub(crate) struct StringPool {
    strings: Vec<String>,
    indices: HashMap<String, u32>,
}

impl StringPool {
    /// A string that no other shares: the name of an attribute, which is known by its place.
    pub(crate) fn add_apart(&mut self, string: &str) -> u32 {
        self.strings.push(string.to_owned());
        size(self.strings.len() - 1)
    }

    /// The string's index; equal strings have one.
    pub(crate) fn add(&mut self, string: &str) -> u32 {
        if let Some(index) = self.indices.get(string) {
            return *index;
        }
        let index = self.add_apart(string);
        self.indices.insert(string.to_owned(), index);
        index
    }

    /// The pool's chunk.
    pub(crate) fn encode(&self, encoding: Encoding) -> Vec<u8> {
        let utf8 =
            encoding == Encoding::Utf8 && self.strings.iter().all(|string| fits_utf8(string));
        let mut offsets = Vec::with_capacity(self.strings.len());
        let mut data = Vec::new();
        for string in &self.strings {
            offsets.push(size(data.len()));
            if utf8 {
                push_utf8(&mut data, string);
            } else {
                push_utf16(&mut data, string);
            }
        }
        data.resize(data.len().next_multiple_of(4), 0);
        let count = size(self.strings.len());
        let start = size(HEADER + 5 * 4 + offsets.len() * 4);
        let header = words([count, 0, if utf8 { UTF8_FLAG } else { 0 }, start, 0]);
        let mut body = words(offsets);
        body.extend(data);
        chunk(kind::STRING_POOL, &header, &body)
    }
}

fn fits_utf8(string: &str) -> bool {
    string.len() <= LONGEST_UTF8 && string.chars().all(|one| one.len_utf16() == 1)
}

/// Both lengths, the bytes, a zero.
fn push_utf8(data: &mut Vec<u8>, string: &str) {
    for length in [string.encode_utf16().count(), string.len()] {
        let [.., high, low] = size(length).to_be_bytes();
        if length > 0x7f {
            data.push(high | 0x80);
        }
        data.push(low);
    }
    data.extend(string.as_bytes());
    data.push(0);
}

/// The length, the units, a zero.
fn push_utf16(data: &mut Vec<u8>, string: &str) {
    let length = size(string.encode_utf16().count());
    let [a, b, c, d] = length.to_be_bytes();
    if length > 0x7fff {
        data.extend(u16::from_be_bytes([a | 0x80, b]).to_le_bytes());
    }
    data.extend(u16::from_be_bytes([c, d]).to_le_bytes());
    data.extend(string.encode_utf16().chain([0]).flat_map(u16::to_le_bytes));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn u16_at(bytes: &[u8], at: usize) -> usize {
        usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
    }

    fn u32_at(bytes: &[u8], at: usize) -> usize {
        u16_at(bytes, at) | u16_at(bytes, at + 2) << 16
    }

    /// Reads a pool as `ResStringPool::string8At` and `stringAt` do, from their description.
    fn decode(pool: &[u8]) -> (bool, Vec<String>) {
        assert_eq!(u16_at(pool, 0), 1, "the type of a string pool");
        assert_eq!(u32_at(pool, 4), pool.len(), "a chunk states its size");
        assert_eq!(pool.len() % 4, 0, "chunks are words");
        let (count, flags, start) = (u32_at(pool, 8), u32_at(pool, 16), u32_at(pool, 20));
        let utf8 = flags & 0x100 != 0;
        let strings = (0..count)
            .map(|one| {
                let mut at = start + u32_at(pool, 28 + 4 * one);
                if utf8 {
                    let mut length = || {
                        let mut value = usize::from(pool[at]);
                        at += 1;
                        if value & 0x80 != 0 {
                            value = (value & 0x7f) << 8 | usize::from(pool[at]);
                            at += 1;
                        }
                        value
                    };
                    let (units, bytes) = (length(), length());
                    let string = String::from_utf8(pool[at..at + bytes].to_vec()).expect("UTF-8");
                    assert_eq!(
                        string.encode_utf16().count(),
                        units,
                        "the length in UTF-16 units"
                    );
                    assert_eq!(pool[at + bytes], 0, "a string ends in a zero");
                    string
                } else {
                    let mut length = u16_at(pool, at);
                    at += 2;
                    if length & 0x8000 != 0 {
                        length = (length & 0x7fff) << 16 | u16_at(pool, at);
                        at += 2;
                    }
                    let units: Vec<u16> = (0..length)
                        .map(|unit| {
                            u16::from_le_bytes([pool[at + 2 * unit], pool[at + 2 * unit + 1]])
                        })
                        .collect();
                    assert_eq!(u16_at(pool, at + 2 * length), 0, "a string ends in a zero");
                    String::from_utf16(&units).expect("UTF-16")
                }
            })
            .collect();
        (utf8, strings)
    }

    fn text() -> impl Strategy<Value = String> {
        prop_oneof![
            4 => any::<String>(),
            2 => "[a-zäß€ ]{0,300}",
            // Around the lengths that take another unit.
            1 => (0x7e_usize..0x82).prop_map(|length| "x".repeat(length)),
            1 => (0x7ffd_usize..0x8002).prop_map(|length| "x".repeat(length)),
            1 => (0x2aa9_usize..0x2aac).prop_map(|length| "€".repeat(length)),
            1 => Just("y".repeat(0x1_0005)),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn strings_of_any_length_come_back_from_a_pool(strings in prop::collection::vec(text(), 0..20)) {
            let mut pool = StringPool::default();
            for string in &strings {
                pool.add_apart(string);
            }
            let (utf8, back) = decode(&pool.encode(Encoding::Utf16));
            prop_assert!(!utf8);
            prop_assert_eq!(&back, &strings);
            let (utf8, back) = decode(&pool.encode(Encoding::Utf8));
            prop_assert_eq!(utf8, strings.iter().all(|one| one.len() < 0x8000 && one.chars().all(|c| c <= '\u{ffff}')));
            prop_assert_eq!(&back, &strings);
        }

        #[test]
        fn equal_strings_are_stored_once(strings in prop::collection::vec("[a-d]{0,2}", 0..40)) {
            let mut pool = StringPool::default();
            let indices: Vec<u32> = strings.iter().map(|string| pool.add(string)).collect();
            let (_, back) = decode(&pool.encode(Encoding::Utf8));
            for (index, string) in indices.iter().zip(&strings) {
                prop_assert_eq!(&back[*index as usize], string);
            }
            let distinct: std::collections::BTreeSet<_> = strings.iter().collect();
            prop_assert_eq!(back.len(), distinct.len());
        }
    }
}
