//! All state of a training in one safetensors file.
//!
//! Arrays of numbers are tensors; what is not an array is one JSON text in the file's metadata. It is written beside the file and moved
//! into place, so that there is always a whole one.

use crate::error::TrainError;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Raised whenever a checkpoint means something else.
pub const VERSION: u32 = 5;
/// The oldest version that can be read: 4 has no perceptual loss.
pub const OLDEST: u32 = 4;

/// The text's key in the metadata.
const TEXT: &str = "mon3tr-training";
/// Most bytes of a checkpoint: several times what the largest avatar and its moments take.
const MOST_BYTES: u64 = 16 << 30;
/// Most bytes of its header: names and shapes of the tensors, and the text.
const MOST_HEADER: u64 = 16 << 20;

/// Tensors on their way into a file.
#[derive(Debug, Default)]
pub struct Writer<'a> {
    tensors: Vec<(String, Dtype, usize, &'a [u8])>,
    /// Those of them that are single-precision numbers.
    numbers: Vec<(String, &'a [f32])>,
}

impl<'a> Writer<'a> {
    /// Adds single-precision numbers.
    pub fn numbers(&mut self, name: impl Into<String>, values: &'a [f32]) {
        let name = name.into();
        self.numbers.push((name.clone(), values));
        let bytes = bytemuck::cast_slice(values);
        self.tensors.push((name, Dtype::F32, values.len(), bytes));
    }

    /// Adds indices or counts.
    pub fn indices(&mut self, name: impl Into<String>, values: &'a [u32]) {
        let bytes = bytemuck::cast_slice(values);
        self.tensors
            .push((name.into(), Dtype::U32, values.len(), bytes));
    }

    /// Adds another file's bytes.
    pub fn bytes(&mut self, name: impl Into<String>, values: &'a [u8]) {
        self.tensors
            .push((name.into(), Dtype::U8, values.len(), values));
    }

    /// Writes the file: complete or, on an error, what it was before.
    ///
    /// # Errors
    /// Numbers that are not finite, which no training goes on from; a file that cannot be written.
    pub fn write(&self, path: &Path, text: &impl Serialize) -> Result<(), TrainError> {
        let refused = |reason: String| TrainError::checkpoint(path, reason);
        let text = serde_json::to_string(text).map_err(|e| refused(e.to_string()))?;
        for (name, numbers) in &self.numbers {
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(refused(format!(
                    "not written, since a number of {name} is not finite"
                )));
            }
        }
        let views = self
            .tensors
            .iter()
            .map(|(name, dtype, length, bytes)| {
                TensorView::new(*dtype, vec![*length], bytes).map(|view| (name.as_str(), view))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(|e| refused(e.to_string()))?;
        // One key, so that the order of a map has no say in the bytes.
        let metadata = HashMap::from([(TEXT.to_owned(), text)]);
        let bytes =
            safetensors::serialize(views, Some(metadata)).map_err(|e| refused(e.to_string()))?;
        write_in_place(path, &bytes)
    }
}

/// Writes a file beside `path` and moves it there.
///
/// # Errors
/// If it cannot be written; `path` is then what it was before.
pub fn write_in_place(path: &Path, bytes: &[u8]) -> Result<(), TrainError> {
    let failed = |action, source| TrainError::File {
        action,
        path: path.to_path_buf(),
        source,
    };
    let mut partial = PathBuf::from(path).into_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    let written = File::create(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .map_err(|source| failed("write", source));
    let moved = written
        .and_then(|()| std::fs::rename(&partial, path).map_err(|source| failed("replace", source)));
    if moved.is_err() {
        // Best effort: the error that is returned says what went wrong.
        let _ = std::fs::remove_file(&partial);
    }
    moved
}

/// A checkpoint's bytes and where they are from.
#[derive(Debug)]
pub struct Stored {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Stored {
    /// Reads the file.
    ///
    /// # Errors
    /// A file that cannot be read, or is larger than any checkpoint.
    pub fn read(path: &Path) -> Result<Self, TrainError> {
        let failed = |source| TrainError::File {
            action: "read",
            path: path.to_path_buf(),
            source,
        };
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        if length > MOST_BYTES {
            let reason = format!("{length} bytes are more than any checkpoint has");
            return Err(TrainError::checkpoint(path, reason));
        }
        let mut bytes = Vec::new();
        file.take(MOST_BYTES)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        Ok(Self {
            path: path.to_path_buf(),
            bytes,
        })
    }

    /// Its tensors and its text.
    ///
    /// # Errors
    /// A file that is no checkpoint, or damaged.
    pub fn open<T: DeserializeOwned>(&self) -> Result<(Reader<'_>, T), TrainError> {
        let refused = |reason: String| TrainError::checkpoint(&self.path, reason);
        let header = self
            .bytes
            .first_chunk()
            .map_or(u64::MAX, |length| u64::from_le_bytes(*length));
        if header > MOST_HEADER {
            return Err(refused("not a checkpoint, or cut short".to_owned()));
        }
        let (_, metadata) =
            SafeTensors::read_metadata(&self.bytes).map_err(|e| refused(e.to_string()))?;
        let text = metadata
            .metadata()
            .as_ref()
            .and_then(|map| map.get(TEXT))
            .ok_or_else(|| refused("a safetensors file, but no checkpoint".to_owned()))?;
        let text = serde_json::from_str(text).map_err(|e| {
            refused(format!(
                "its text cannot be read ({e}): it may be of another version of this program"
            ))
        })?;
        let tensors = SafeTensors::deserialize(&self.bytes).map_err(|e| refused(e.to_string()))?;
        Ok((
            Reader {
                path: &self.path,
                tensors,
            },
            text,
        ))
    }
}

/// A checkpoint's tensors.
#[derive(Debug)]
pub struct Reader<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
}

impl Reader<'_> {
    /// Single-precision numbers, `expected` of them, all finite.
    ///
    /// # Errors
    /// A tensor that is missing, of another type or length, or holds a number that is not finite.
    pub fn numbers(&self, name: &str, expected: usize) -> Result<Vec<f32>, TrainError> {
        let values: Vec<f32> = self.typed(name, Dtype::F32, Some(expected))?;
        if values.iter().all(|value| value.is_finite()) {
            return Ok(values);
        }
        Err(self.refused(format!("a number of {name} is not finite")))
    }

    /// Indices or counts, `expected` of them.
    ///
    /// # Errors
    /// A tensor that is missing, or of another type or length.
    pub fn indices(&self, name: &str, expected: usize) -> Result<Vec<u32>, TrainError> {
        self.typed(name, Dtype::U32, Some(expected))
    }

    /// Another file's bytes.
    ///
    /// # Errors
    /// A tensor that is missing, or of another type.
    pub fn bytes(&self, name: &str) -> Result<Vec<u8>, TrainError> {
        self.typed(name, Dtype::U8, None)
    }

    /// An error about this file.
    #[must_use]
    pub fn refused(&self, reason: impl Into<String>) -> TrainError {
        TrainError::checkpoint(self.path, reason)
    }

    fn typed<T: bytemuck::Pod>(
        &self,
        name: &str,
        dtype: Dtype,
        expected: Option<usize>,
    ) -> Result<Vec<T>, TrainError> {
        let view = self
            .tensors
            .tensor(name)
            .map_err(|_| self.refused(format!("{name} is missing")))?;
        let [length] = *view.shape() else {
            return Err(self.refused(format!("{name} has another shape than a list")));
        };
        if view.dtype() != dtype || expected.is_some_and(|expected| expected != length) {
            return Err(self.refused(format!(
                "{name} has {length} numbers of {:?}, not {} of {dtype:?}",
                view.dtype(),
                expected.unwrap_or(length)
            )));
        }
        // A copy, because the bytes may be unaligned.
        let mut values = vec![T::zeroed(); view.data().len() / size_of::<T>()];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(view.data());
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(folder: &Path) -> PathBuf {
        let path = folder.join("checkpoint.safetensors");
        let mut writer = Writer::default();
        writer.numbers("a", &[1.0, -2.5]);
        writer.indices("b", &[7, 8, 9]);
        writer.bytes("c", b"text");
        writer.write(&path, &vec![3u32, 4]).expect("written");
        path
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let stored = Stored::read(&written(folder.path())).expect("read");
        let (reader, text) = stored.open::<Vec<u32>>().expect("opened");
        assert_eq!(text, [3, 4], "the text");
        assert_eq!(reader.numbers("a", 2).expect("a"), [1.0, -2.5], "numbers");
        assert_eq!(reader.indices("b", 3).expect("b"), [7, 8, 9], "indices");
        assert_eq!(reader.bytes("c").expect("c"), b"text", "bytes");
        let said = reader.numbers("a", 3).expect_err("two").to_string();
        assert!(said.contains("a has 2 numbers"), "{said}");
        assert!(reader.numbers("b", 3).is_err(), "another type");
        assert!(reader.numbers("d", 3).is_err(), "none");
    }

    #[test]
    fn numbers_that_are_not_finite_are_not_written_over_good_ones() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = written(folder.path());
        let before = std::fs::read(&path).expect("read");
        let mut writer = Writer::default();
        writer.numbers("first", &[1.0]);
        writer.numbers("second", &[1.0, f32::NAN]);
        let said = writer.write(&path, &0).expect_err("refused").to_string();
        assert!(said.contains("second is not finite"), "{said}");
        assert_eq!(std::fs::read(&path).expect("read"), before, "as it was");
    }

    #[test]
    fn a_write_that_fails_leaves_the_file_as_it_was() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("gone").join("file");
        assert!(write_in_place(&path, b"x").is_err(), "there is no folder");
        let path = folder.path().join("file");
        write_in_place(&path, b"x").expect("written");
        let names = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(names, 1, "nothing is left beside it");
    }

    proptest! {
        #[test]
        fn a_damaged_checkpoint_is_an_error_and_no_panic(
            at in 0usize..400,
            bits in 1u8..=255,
            cut in prop::option::of(0usize..400),
        ) {
            let folder = tempfile::tempdir().expect("a folder");
            let path = written(folder.path());
            let mut bytes = std::fs::read(&path).expect("read");
            let at = at % bytes.len();
            bytes[at] ^= bits;
            if let Some(cut) = cut {
                bytes.truncate(cut);
            }
            let stored = Stored { path, bytes };
            if let Ok((reader, _)) = stored.open::<Vec<u32>>() {
                let _ = reader.numbers("a", 2);
                let _ = reader.indices("b", 3);
                let _ = reader.bytes("c");
            }
        }
    }
}
