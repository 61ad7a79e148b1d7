//! JSON files read with the path of each field, so that a message names the field that is wrong.

use crate::error::CaptureError;
use serde_json::Value;
use std::io::Read;
use std::path::Path;

/// Bytes of the largest text file: calibrations of a thousand cameras.
const MAX_TEXT: u64 = 16 << 20;

/// Reads a text file of bounded size.
pub(crate) fn read_text(path: &Path) -> Result<String, CaptureError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_TEXT + 1).read_to_end(&mut bytes))
        .map_err(|source| CaptureError::read(path, source))?;
    if bytes.len() as u64 > MAX_TEXT {
        let reason = format!("has more than {} MiB", MAX_TEXT >> 20);
        return Err(CaptureError::field(path, "the file", reason));
    }
    String::from_utf8(bytes).map_err(|_| CaptureError::field(path, "the file", "is no UTF-8 text"))
}

/// Reads a JSON file.
pub(crate) fn read(path: &Path) -> Result<Value, CaptureError> {
    serde_json::from_str(&read_text(path)?).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        CaptureError::field(path, place, format!("is no JSON: {e}"))
    })
}

/// A value of a file, and where it is.
#[derive(Debug, Clone)]
pub(crate) struct Node<'a> {
    file: &'a Path,
    path: String,
    value: &'a Value,
}

impl<'a> Node<'a> {
    pub(crate) fn root(file: &'a Path, value: &'a Value) -> Self {
        Self {
            file,
            path: String::new(),
            value,
        }
    }

    /// An error about this value.
    pub(crate) fn wrong(&self, reason: impl Into<String>) -> CaptureError {
        let path = if self.path.is_empty() {
            "the file"
        } else {
            &self.path
        };
        CaptureError::field(self.file, path, reason)
    }

    fn under(&self, path: String, value: &'a Value) -> Self {
        Self {
            file: self.file,
            path,
            value,
        }
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// A member that must be there.
    pub(crate) fn get(&self, key: &str) -> Result<Self, CaptureError> {
        self.find(key)
            .ok_or_else(|| CaptureError::field(self.file, self.path_of(key), "is missing"))
    }

    /// A member that may be there.
    pub(crate) fn find(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key)?;
        Some(self.under(self.path_of(key), value))
    }

    /// An object's members in the file's order of sorted keys.
    pub(crate) fn members(&self) -> Result<Vec<(&'a str, Self)>, CaptureError> {
        let object = (self.value.as_object()).ok_or_else(|| self.wrong("must be an object"))?;
        Ok(object
            .iter()
            .map(|(key, value)| (key.as_str(), self.under(self.path_of(key), value)))
            .collect())
    }

    pub(crate) fn items(&self) -> Result<Vec<Self>, CaptureError> {
        let list = (self.value.as_array()).ok_or_else(|| self.wrong("must be a list"))?;
        Ok(list
            .iter()
            .enumerate()
            .map(|(k, value)| self.under(format!("{}[{k}]", self.path), value))
            .collect())
    }

    pub(crate) fn text(&self) -> Result<&'a str, CaptureError> {
        (self.value.as_str()).ok_or_else(|| self.wrong("must be a text"))
    }

    /// A finite number.
    pub(crate) fn number(&self) -> Result<f64, CaptureError> {
        (self.value.as_f64())
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.wrong("must be a number"))
    }

    /// A count, up to a limit.
    pub(crate) fn count(&self, most: usize) -> Result<usize, CaptureError> {
        (self.value.as_u64())
            .and_then(|count| usize::try_from(count).ok())
            .filter(|count| *count <= most)
            .ok_or_else(|| self.wrong(format!("must be a whole number up to {most}")))
    }

    /// Width or height of a picture: a whole number, possibly written with a point.
    pub(crate) fn side(&self) -> Result<u32, CaptureError> {
        let most = f64::from(crate::camera::LARGEST_SIDE);
        let number = self.number()?;
        if number.fract() != 0.0 || !(1.0..=most).contains(&number) {
            return Err(self.wrong(format!("is {number}; 1 to {most} pixels are possible")));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number in range, checked above"
        )]
        Ok(number as u32)
    }

    /// Exactly `N` numbers, in a list or in lists of lists.
    pub(crate) fn numbers<const N: usize>(&self) -> Result<[f64; N], CaptureError> {
        let flat = self.flat(N)?;
        <[f64; N]>::try_from(flat.as_slice())
            .map_err(|_| self.wrong(format!("has {} numbers where {N} are needed", flat.len())))
    }

    /// Numbers of a list or of lists of lists, at most a few more than `most`.
    pub(crate) fn flat(&self, most: usize) -> Result<Vec<f64>, CaptureError> {
        let mut flat = Vec::new();
        self.gather(most + 16, &mut flat, true)?;
        Ok(flat)
    }

    /// Adds the numbers of this list until there are `most`; of lists in it too, if it may have them. Only numbers that are wrong get a node.
    fn gather(&self, most: usize, flat: &mut Vec<f64>, nested: bool) -> Result<(), CaptureError> {
        let list = (self.value.as_array()).ok_or_else(|| self.wrong("must be a list"))?;
        for (k, value) in list.iter().enumerate() {
            if flat.len() >= most {
                break;
            }
            let node = || self.under(format!("{}[{k}]", self.path), value);
            match value.as_f64() {
                Some(number) if number.is_finite() => flat.push(number),
                _ if nested && value.is_array() => node().gather(most, flat, false)?,
                _ => flat.push(node().number()?),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_up_to_their_limit_and_what_is_wrong_is_named_by_its_place() {
        let file = Path::new("a.json");
        let read = |text: &str| -> Result<Vec<f64>, CaptureError> {
            let value: Value = serde_json::from_str(text).expect("JSON");
            Node::root(file, &value).flat(3)
        };
        assert_eq!(
            read("[[1, 2], 3]").expect("numbers"),
            [1.0, 2.0, 3.0],
            "nested"
        );
        let long = format!("[[{}]]", vec!["0"; 5000].join(","));
        assert_eq!(
            read(&long).expect("numbers").len(),
            3 + 16,
            "no more is gathered"
        );
        for (text, place) in [
            ("[1, [2, \"x\"]]", "`[1][1]`"),
            ("[1, null]", "`[1]`"),
            ("[[[1]]]", "`[0][0]`"),
            ("3", "`the file`"),
        ] {
            let said = read(text).expect_err("refused").to_string();
            assert!(said.contains(place), "{text}: {said}");
        }
    }
}
