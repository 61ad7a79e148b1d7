//! Functions of Rust's standard library that are only stubs on Android: they compile, and each call is an error or has a
//! useless result. A library that has one of them in it is not packaged.
//!
//! Looked for are the functions' names, in the library before these are stripped off it, and the words of their errors: those stay where
//! the compiler put a function into its caller. clippy.toml forbids them in our own code; crates of others may call them too.

use std::fmt;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

/// A stub function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stub {
    /// The function.
    pub name: &'static str,
    /// Its error text.
    pub says: &'static str,
    /// The first Rust that implements it, where that is known.
    pub fixed_in: Option<&'static str>,
    /// What to use.
    pub instead: &'static str,
}

/// Rust 1.95's, by `library/std/src/sys` (what is missing in lists of systems that do not name Android).
pub const STUBS: [Stub; 6] = [
    lock("std::fs::File::lock", "lock() not supported"),
    lock("std::fs::File::lock_shared", "lock_shared() not supported"),
    lock("std::fs::File::try_lock", "try_lock() not supported"),
    lock(
        "std::fs::File::try_lock_shared",
        "try_lock_shared() not supported",
    ),
    lock("std::fs::File::unlock", "unlock() not supported"),
    Stub {
        name: "std::fs::Metadata::created",
        says: "creation time is not available on this platform currently",
        fixed_in: None,
        instead: "Metadata::modified",
    },
];

const fn lock(name: &'static str, says: &'static str) -> Stub {
    Stub {
        name,
        says,
        // rust-lang/rust#148325
        fixed_in: Some("1.98"),
        instead: "rustix::fs::flock",
    }
}

impl fmt::Display for Stub {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            says,
            fixed_in,
            instead,
        } = self;
        write!(f, "{name} is an error on Android (\"{says}\")")?;
        if let Some(fixed_in) = fixed_in {
            write!(f, " before Rust {fixed_in}")?;
        }
        write!(f, ": use {instead}")
    }
}

/// Why a library cannot be checked or packaged.
#[derive(Debug, thiserror::Error)]
pub enum StubError {
    /// It calls some of them.
    #[error("{} calls what Android has in name alone: {}", path.display(), listed(stubs))]
    Found {
        /// The library.
        path: PathBuf,
        /// Which.
        stubs: Vec<&'static Stub>,
    },
    /// Its names were stripped off, or it is of another kind.
    #[error("{} has no names to look for", path.display())]
    NoNames {
        /// The library.
        path: PathBuf,
    },
    /// It cannot be read.
    #[error("could not read {}", path.display())]
    Read {
        /// The library.
        path: PathBuf,
        /// Why not.
        #[source]
        source: std::io::Error,
    },
}

fn listed(stubs: &[&Stub]) -> String {
    let texts: Vec<String> = stubs.iter().map(ToString::to_string).collect();
    texts.join("; ")
}

/// Looks for all of them in the library at `path`, which has its names still.
///
/// # Errors
/// [`StubError::Found`] if there are some; the others if the library cannot be checked.
pub fn check(path: &Path) -> Result<(), StubError> {
    let data = std::fs::read(path).map_err(|source| StubError::Read {
        path: path.to_owned(),
        source,
    })?;
    let found = find(&data).ok_or_else(|| StubError::NoNames {
        path: path.to_owned(),
    })?;
    if found.is_empty() {
        return Ok(());
    }
    Err(StubError::Found {
        path: path.to_owned(),
        stubs: found,
    })
}

/// Those that a library with its names has; nothing where it has no names.
#[must_use]
pub fn find(library: &[u8]) -> Option<Vec<&'static Stub>> {
    let file = object::File::parse(library).ok()?;
    let names: Vec<&str> = (file.symbols())
        .filter_map(|symbol| symbol.name().ok())
        .collect();
    if names.is_empty() {
        return None;
    }
    let texts = (file.sections())
        .filter(|section| {
            matches!(
                section.kind(),
                SectionKind::ReadOnlyData | SectionKind::ReadOnlyString
            )
        })
        .filter_map(|section| section.data().ok());
    let texts: Vec<&[u8]> = texts.collect();
    let found = (STUBS.iter())
        .filter(|stub| is_among(stub, &names) || texts.iter().any(|text| says(stub, text)));
    Some(found.collect())
}

fn is_among(stub: &Stub, names: &[&str]) -> bool {
    let last = stub.name.rsplit("::").next().unwrap_or_default();
    let mut likely = names.iter().filter(|name| name.contains(last));
    likely.any(|name| readable(name) == stub.name)
}

/// Whether a stub's words stand there, and not as the end of another's: texts of a Rust program follow one another without a mark
/// between them.
fn says(stub: &Stub, text: &[u8]) -> bool {
    let longer = STUBS
        .iter()
        .filter_map(|other| other.says.strip_suffix(stub.says))
        .filter(|before| !before.is_empty());
    let longer: Vec<&str> = longer.collect();
    let words = stub.says.as_bytes();
    (text.windows(words.len()).enumerate())
        .filter(|(_, here)| *here == words)
        .any(|(at, _)| {
            let mut before = longer.iter();
            !before.any(|before| text[..at].ends_with(before.as_bytes()))
        })
}

/// A function's name as it is written in the source. A method is `<std::fs::File>::lock` where names are mangled as they are since
/// Rust 1.91, and was `std::fs::File::lock` before.
fn readable(symbol: &str) -> String {
    let name = format!("{:#}", rustc_demangle::demangle(symbol));
    match name
        .strip_prefix('<')
        .and_then(|rest| rest.split_once(">::"))
    {
        Some((owner, method)) if !owner.contains(" as ") => format!("{owner}::{method}"),
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn names_are_read_in_both_manglings() {
        for symbol in [
            "_ZN3std2fs4File8try_lock17h0123456789abcdefE",
            "_RNvMs2_NtCs6YvSDYEE77W_3std2fsNtB5_4File8try_lock",
        ] {
            assert_eq!(readable(symbol), "std::fs::File::try_lock", "{symbol}");
        }
        for other in [
            "try_lock",
            "_ZN3std4sync6poison5mutex14Mutex$LT$T$GT$8try_lock17h0123456789abcdefE",
        ] {
            assert_ne!(readable(other), "std::fs::File::try_lock", "{other}");
        }
    }

    #[test]
    fn error_texts_are_distinguished_from_the_ends_of_others() {
        let found = |text: &str| {
            let found = STUBS.iter().filter(|stub| says(stub, text.as_bytes()));
            found.map(|stub| stub.name).collect::<Vec<_>>()
        };
        assert_eq!(
            found("unlock() not supportedtry_lock_shared() not supported"),
            ["std::fs::File::try_lock_shared", "std::fs::File::unlock"],
            "neither is a lock()"
        );
        assert_eq!(
            found("unlock() not supportedlock() not supported"),
            ["std::fs::File::lock", "std::fs::File::unlock"],
            "both are there"
        );
    }

    /// The standard library as this Rust has it for the headset.
    fn androids_own() -> Option<Vec<u8>> {
        let mut rustc = Command::new("rustc");
        rustc.args([
            "--print",
            "target-libdir",
            "--target",
            "aarch64-linux-android",
        ]);
        let folder = rustc.output().expect("rustc starts").stdout;
        let folder = PathBuf::from(String::from_utf8(folder).expect("a path").trim());
        let Ok(files) = std::fs::read_dir(&folder) else {
            let must = std::env::var("CI").as_deref() == Ok("true");
            assert!(!must, "CI must have Rust's library for the headset");
            println!("skipped: Rust has no standard library for aarch64-linux-android");
            return None;
        };
        let mut paths = files.filter_map(|file| Some(file.ok()?.path()));
        let path = paths.find(|path| {
            let name = path.file_name().and_then(|name| name.to_str());
            name.is_some_and(|name| name.starts_with("libstd-") && name.ends_with(".so"))
        });
        Some(std::fs::read(path.expect("a library")).expect("it is read"))
    }

    #[test]
    fn the_table_lists_the_stubs_of_androids_standard_library() {
        let Some(library) = androids_own() else {
            return;
        };
        let found = find(&library).expect("it has its names");
        assert_eq!(found, STUBS.iter().collect::<Vec<_>>(), "all of them");
        let file = object::File::parse(&*library).expect("ELF");
        let names: Vec<&str> = file.symbols().filter_map(|one| one.name().ok()).collect();
        for stub in &STUBS {
            assert!(is_among(stub, &names), "{stub}: by its name");
            assert!(says(stub, &library), "{stub}: by its words");
        }
    }
}
