//! Folders of numbered pictures: one camera's frames or masks.

use crate::error::CaptureError;
use std::path::{Path, PathBuf};

/// Most entries of a folder that are looked at.
const MOST_FILES: usize = 1 << 20;
/// Digits of the largest number.
const MOST_DIGITS: usize = 9;
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Numbered pictures of a folder: their names, and which numbers there are.
#[derive(Debug, Clone)]
pub(crate) struct Numbered {
    names: Names,
    /// Ascending.
    numbers: Vec<u32>,
}

/// How a folder's pictures are called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Names {
    folder: PathBuf,
    prefix: String,
    digits: usize,
    ending: String,
}

impl Names {
    /// The file of a number.
    pub(crate) fn path(&self, number: u32) -> PathBuf {
        let Self {
            folder,
            prefix,
            digits,
            ending,
        } = self;
        folder.join(format!("{prefix}{number:0digits$}.{ending}"))
    }
}

impl Numbered {
    /// Lists the files `<prefix><digits>.<png, jpg or jpeg>` of a folder, whatever their order in it. Other files are passed over.
    ///
    /// # Errors
    /// A folder that cannot be read or has no such file; names that differ in their number of digits or their ending.
    pub(crate) fn list(folder: &Path, prefix: &str) -> Result<Self, CaptureError> {
        let mut found: Vec<(u32, usize, String)> = Vec::new();
        let entries = std::fs::read_dir(folder).map_err(|e| CaptureError::read(folder, e))?;
        for entry in entries.take(MOST_FILES) {
            let entry = entry.map_err(|e| CaptureError::read(folder, e))?;
            found.extend(
                entry
                    .file_name()
                    .to_str()
                    .and_then(|name| split(name, prefix)),
            );
        }
        found.sort();
        let Some((_, digits, ending)) = found.first().cloned() else {
            let reason = format!("it has no picture {prefix}<number>.png or .jpg");
            return Err(CaptureError::Layout {
                folder: folder.to_owned(),
                reason,
            });
        };
        let names = Names {
            folder: folder.to_owned(),
            prefix: prefix.to_owned(),
            digits,
            ending,
        };
        let other = (found.iter()).find(|(number, d, e)| {
            (*d, e) != (names.digits, &names.ending)
                // A number with more digits than the padding.
                && !(e == &names.ending && *d > digits && number.to_string().len() == *d)
        });
        if let Some((number, digits, ending)) = other {
            let path = folder.join(format!("{prefix}{number:0digits$}.{ending}"));
            let reason = format!(
                "is not named as the others, such as {}: rename it, or take it away",
                names.path(found[0].0).display()
            );
            return Err(CaptureError::picture(&path, reason));
        }
        Ok(Self {
            names,
            numbers: found.into_iter().map(|(number, ..)| number).collect(),
        })
    }

    /// The numbers that there are, ascending.
    pub(crate) fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Whether there is a number.
    pub(crate) fn has(&self, number: u32) -> bool {
        self.numbers.binary_search(&number).is_ok()
    }

    /// The first of `numbers` that is not there, as an error.
    pub(crate) fn check_all(&self, numbers: &[u32]) -> Result<(), CaptureError> {
        match numbers.iter().find(|number| !self.has(**number)) {
            None => Ok(()),
            Some(number) => Err(CaptureError::picture(
                &self.names.path(*number),
                "is missing",
            )),
        }
    }

    pub(crate) fn into_names(self) -> Names {
        self.names
    }
}

/// Number, digits and ending of a name.
fn split(name: &str, prefix: &str) -> Option<(u32, usize, String)> {
    let (stem, ending) = name.strip_prefix(prefix)?.rsplit_once('.')?;
    let fits = (1..=MOST_DIGITS).contains(&stem.len()) && stem.bytes().all(|b| b.is_ascii_digit());
    let known = ENDINGS.iter().any(|e| ending.eq_ignore_ascii_case(e));
    (fits && known).then_some((stem.parse().ok()?, stem.len(), ending.to_owned()))
}
