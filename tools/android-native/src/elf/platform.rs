//! The libraries and symbols of Android API level 29.

use std::collections::{BTreeMap, BTreeSet};

/// The lists, one for each library that ours link; written by `scripts/android-api.py`.
const LISTS: [(&str, &str); 6] = [
    ("libc.so", include_str!("../../api-29/libc.txt")),
    ("libm.so", include_str!("../../api-29/libm.txt")),
    ("libdl.so", include_str!("../../api-29/libdl.txt")),
    ("liblog.so", include_str!("../../api-29/liblog.txt")),
    ("libandroid.so", include_str!("../../api-29/libandroid.txt")),
    ("libaaudio.so", include_str!("../../api-29/libaaudio.txt")),
];

const LIBRARIES: &str = include_str!("../../api-29/libraries.txt");

/// The platform's libraries and what they export to applications.
#[derive(Debug, Clone)]
pub struct Platform {
    exports: BTreeMap<&'static str, BTreeSet<&'static str>>,
    libraries: BTreeSet<&'static str>,
}

impl Platform {
    /// Android at API level 29 on arm64, the least that the package is installed on.
    #[must_use]
    pub fn api_29() -> Self {
        Self {
            exports: LISTS
                .map(|(library, list)| (library, names(list).collect()))
                .into(),
            libraries: names(LIBRARIES).collect(),
        }
    }

    /// What `library` exports; nothing where there is no list of it.
    #[must_use]
    pub fn exports_of(&self, library: &str) -> Option<&BTreeSet<&'static str>> {
        self.exports.get(library)
    }

    /// The libraries that have a list of their exports.
    pub fn listed(&self) -> impl Iterator<Item = (&'static str, &BTreeSet<&'static str>)> {
        self.exports
            .iter()
            .map(|(library, names)| (*library, names))
    }

    /// Whether an application can open `library` by its name.
    #[must_use]
    pub fn has_library(&self, library: &str) -> bool {
        self.libraries.contains(library)
    }
}

fn names(list: &'static str) -> impl Iterator<Item = &'static str> {
    list.lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
}
