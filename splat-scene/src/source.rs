//! The bytes being read, what errors call them, and reading numbers out of them without a chance to panic.

use crate::{Format, MAX_GAUSSIANS, SceneError};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A file's content under the name that errors show.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) name: &'a str,
    pub(crate) bytes: &'a [u8],
}

impl Source<'_> {
    pub(crate) fn damaged(&self, format: Format, what: impl Into<String>) -> SceneError {
        SceneError::Damaged {
            name: self.name.to_owned(),
            format,
            what: what.into(),
        }
    }

    pub(crate) fn unsupported(
        &self,
        format: Format,
        what: impl Into<String>,
        advice: &'static str,
    ) -> SceneError {
        SceneError::Unsupported {
            name: self.name.to_owned(),
            format,
            what: what.into(),
            advice,
        }
    }

    pub(crate) fn truncated(
        &self,
        format: Format,
        what: impl Into<String>,
        need: u64,
        have: usize,
    ) -> SceneError {
        SceneError::Truncated {
            name: self.name.to_owned(),
            format,
            what: what.into(),
            need,
            have: have as u64,
        }
    }

    /// The count a header states as a size in memory, or the error that it is over the limit.
    pub(crate) fn checked_count(&self, count: u64) -> Result<usize, SceneError> {
        usize::try_from(count)
            .ok()
            .filter(|&count| count <= MAX_GAUSSIANS)
            .ok_or_else(|| SceneError::TooManyGaussians {
                name: self.name.to_owned(),
                count,
                limit: MAX_GAUSSIANS as u64,
            })
    }
}

/// The `N` bytes at `offset`, or zeros past the end, which callers rule out by checking lengths first.
pub(crate) fn bytes_at<const N: usize>(bytes: &[u8], offset: usize) -> [u8; N] {
    bytes
        .get(offset..)
        .and_then(|rest| rest.first_chunk())
        .copied()
        .unwrap_or([0; N])
}

pub(crate) fn f32_at(bytes: &[u8], offset: usize) -> f32 {
    f32::from_le_bytes(bytes_at(bytes, offset))
}

pub(crate) fn u32_at(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, offset))
}

/// A file's content, unless it is larger than `limit`: also where its size is not known beforehand, as for a pipe.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    let cannot_read = |source| SceneError::Read {
        path: path.to_owned(),
        source,
    };
    let too_large = |bytes| SceneError::TooLarge {
        name: path.display().to_string(),
        bytes,
        limit,
    };
    let file = File::open(path).map_err(cannot_read)?;
    let size = file.metadata().map_err(cannot_read)?.len();
    if size > limit {
        return Err(too_large(size));
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(size).unwrap_or(0).saturating_add(1))
        .map_err(|_| cannot_read(std::io::ErrorKind::OutOfMemory.into()))?;
    file.take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(cannot_read)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}
