//! The table of resources (`resources.arsc`): for each type its names, and a chunk of values for each kind of device.

use std::collections::BTreeSet;

use super::config::Config;
use super::folder::{Entries, Resource, Resources};
use crate::ApkError;
use crate::binary_xml::{Typed, Value};
use crate::chunk::{HEADER, chunk, kind, size, words};
use crate::string_pool::{Encoding, StringPool};

const PACKAGE_ID: u32 = 0x7f;
/// Units of UTF-16 that a package's name has in the table, a zero at the end.
pub(crate) const PACKAGE_NAME_UNITS: usize = 128;
const NO_ENTRY: u32 = u32::MAX;

impl Resources {
    /// The table, for the package of this name.
    pub(crate) fn table(&self, package: &str) -> Result<Vec<u8>, ApkError> {
        let mut values = StringPool::default();
        let mut type_names = StringPool::default();
        let mut keys = StringPool::default();
        let mut chunks = Vec::new();
        for (index, (name, entries)) in (1_u8..).zip(&self.types) {
            type_names.add(name);
            chunks.extend(specification(index, entries));
            let configs: BTreeSet<Config> = entries
                .values()
                .flat_map(|variants| variants.keys().copied())
                .collect();
            for config in configs {
                chunks.extend(self.variants(index, entries, config, &mut values, &mut keys)?);
            }
        }
        let type_names = type_names.encode(Encoding::Utf8);
        let keys = keys.encode(Encoding::Utf8);

        let mut header = words([PACKAGE_ID]);
        let mut name: Vec<u16> = package
            .encode_utf16()
            .take(PACKAGE_NAME_UNITS - 1)
            .collect();
        name.resize(PACKAGE_NAME_UNITS, 0);
        header.extend(name.into_iter().flat_map(u16::to_le_bytes));
        let first = HEADER + header.len() + 5 * 4;
        header.extend(words([
            size(first),
            0,
            size(first + type_names.len()),
            0,
            0,
        ]));
        let package = chunk(
            kind::TABLE_PACKAGE,
            &header,
            &[type_names, keys, chunks].concat(),
        );
        let body = [values.encode(Encoding::Utf8), package].concat();
        Ok(chunk(kind::TABLE, &words([1]), &body))
    }

    /// A type's values for one kind of device.
    fn variants(
        &self,
        index: u8,
        entries: &Entries,
        config: Config,
        values: &mut StringPool,
        keys: &mut StringPool,
    ) -> Result<Vec<u8>, ApkError> {
        let mut offsets = Vec::with_capacity(entries.len());
        let mut data = Vec::new();
        for (name, variants) in entries {
            let Some(resource) = variants.get(&config) else {
                offsets.push(NO_ENTRY);
                continue;
            };
            let value = match resource {
                Resource::File(member) => Typed::string(values.add(member)),
                Resource::Said(said) => match said.value(&|kind, name| self.id(kind, name))? {
                    Value::Typed(value) => value,
                    Value::Text(text) => Typed::string(values.add(&text)),
                },
            };
            offsets.push(size(data.len()));
            let [value_kind, value_data] = value.words();
            // An entry of 8 bytes, with no flags.
            data.extend(words([8, keys.add(name), value_kind, value_data]));
        }
        let encoded = config.encode();
        let start = HEADER + 3 * 4 + encoded.len() + offsets.len() * 4;
        let mut header = words([u32::from(index), size(offsets.len()), size(start)]);
        header.extend(encoded);
        let mut body = words(offsets);
        body.extend(data);
        Ok(chunk(kind::TABLE_TYPE, &header, &body))
    }
}

/// Which respects of a device matter to each of a type's resources.
fn specification(index: u8, entries: &Entries) -> Vec<u8> {
    let flags = entries.values().map(|variants| {
        let first = variants.keys().next().copied().unwrap_or_default();
        variants.keys().fold(0, |all, config| {
            all | first.differences(*config) | Config::default().differences(*config)
        })
    });
    chunk(
        kind::TABLE_TYPE_SPEC,
        &words([u32::from(index), size(entries.len())]),
        &words(flags),
    )
}
