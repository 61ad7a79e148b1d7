//! The bytes being read, what errors call them, and reading numbers out of them without a chance to panic.

use crate::{Format, MAX_GAUSSIANS, SceneError};

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
