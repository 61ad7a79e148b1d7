//! The reasons why Android would not load a package's libraries.

use std::fmt;

use super::library::Library;
use super::platform::Platform;

/// The least alignment of segments: devices with pages of 16 KiB refuse others.
const PAGE: u64 = 0x4000;

/// Something that keeps a library from being loaded, or the application from being started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fault {
    /// It is for another processor.
    Machine(u16),
    /// It is a program or an object file.
    NotShared,
    /// A library it needs is neither in the package nor the platform's.
    Needs(String),
    /// A library it needs is the platform's, and there is no list of its exports.
    NoList(String),
    /// None of the libraries it needs exports these.
    Unresolved(Vec<String>),
    /// A segment of this alignment cannot be mapped by a device with pages of 16 KiB.
    Alignment(u64),
    /// A segment's place in the file does not fit its address.
    Incongruent,
    /// The loader would have to write into code.
    TextRelocations,
    /// The platform, or android-activity, calls this function, which is missing.
    NoExport(String),
    /// It names a library that it might open, which is neither in the package nor the platform's.
    Opens(String),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Machine(machine) => {
                write!(f, "is for ELF machine {machine}, not 183 (aarch64)")
            }
            Self::NotShared => write!(f, "is not a shared library"),
            Self::Needs(library) => write!(
                f,
                "needs {library}, which is neither in the package nor part of Android API 29"
            ),
            Self::NoList(library) => write!(
                f,
                "needs {library}, of which no list of symbols is kept (scripts/android-api.py)"
            ),
            Self::Unresolved(names) => {
                write!(f, "has undefined symbols that nothing it needs exports: ")?;
                for (place, name) in names.iter().enumerate() {
                    write!(f, "{}{name}", if place == 0 { "" } else { ", " })?;
                }
                Ok(())
            }
            Self::Alignment(alignment) => write!(
                f,
                "has a segment aligned to {alignment:#x}: 0x4000 is the least for pages of 16 KiB"
            ),
            Self::Incongruent => write!(
                f,
                "has a segment whose place in the file does not fit its address"
            ),
            Self::TextRelocations => write!(f, "has relocations in its code"),
            Self::NoExport(name) => write!(f, "does not export {name}"),
            Self::Opens(library) => write!(
                f,
                "names {library}, which is neither in the package nor part of Android API 29"
            ),
        }
    }
}

/// Everything wrong with `library` in a package that has the libraries `beside` it (itself may be one). For the application's own,
/// `own` lists the functions that are called from outside, and every library that it names has to be there; those of others name many
/// that they can do without.
#[must_use]
pub fn check_library(
    library: &Library,
    beside: &[Library],
    platform: &Platform,
    own: Option<&[&str]>,
) -> Vec<Fault> {
    let mut faults = Vec::new();
    check_file(library, &mut faults);
    check_links(library, beside, platform, &mut faults);
    let Some(exports) = own else {
        return faults;
    };
    for export in exports {
        if !library.exports.contains(*export) {
            faults.push(Fault::NoExport((*export).to_owned()));
        }
    }
    for named in &library.named {
        let there = *named == library.name || beside.iter().any(|other| other.name == *named);
        if !there && !platform.has_library(named) && !library.needed.contains(named) {
            faults.push(Fault::Opens(named.clone()));
        }
    }
    faults
}

/// Checks of the file alone.
fn check_file(library: &Library, faults: &mut Vec<Fault>) {
    if !library.is_aarch64() {
        faults.push(Fault::Machine(library.machine));
    }
    if !library.shared {
        faults.push(Fault::NotShared);
    }
    if let Some(&alignment) = library
        .alignments
        .iter()
        .find(|alignment| !alignment.is_multiple_of(PAGE) || **alignment == 0)
    {
        faults.push(Fault::Alignment(alignment));
    }
    if !library.congruent {
        faults.push(Fault::Incongruent);
    }
    if library.text_relocations {
        faults.push(Fault::TextRelocations);
    }
}

/// Checks of what it needs from other libraries.
fn check_links(
    library: &Library,
    beside: &[Library],
    platform: &Platform,
    faults: &mut Vec<Fault>,
) {
    let in_package = |needed: &str| beside.iter().find(|other| other.name == needed);
    for needed in &library.needed {
        if in_package(needed).is_some() || platform.exports_of(needed).is_some() {
            continue;
        }
        faults.push(if platform.has_library(needed) {
            Fault::NoList(needed.clone())
        } else {
            Fault::Needs(needed.clone())
        });
    }
    let unresolved: Vec<String> = library
        .undefined
        .iter()
        .filter(|symbol| !symbol.weak && !library.exports.contains(&symbol.name))
        .filter(|symbol| {
            !library
                .needed
                .iter()
                .any(|needed| match in_package(needed) {
                    Some(other) => other.exports.contains(&symbol.name),
                    None => platform
                        .exports_of(needed)
                        .is_some_and(|names| names.contains(symbol.name.as_str())),
                })
        })
        .map(|symbol| symbol.name.clone())
        .collect();
    if !unresolved.is_empty() {
        faults.push(Fault::Unresolved(unresolved));
    }
}
