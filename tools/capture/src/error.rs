//! What can be wrong with a capture. Each message is one line that names the file and what to do; a cause is the error's `source`.

use spmm3::MotionError;
use std::path::{Path, PathBuf};

/// A capture that cannot be used or written, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// A file or folder could not be read.
    #[error("cannot read {path}: check that it is there and its permissions")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A file or folder could not be written.
    #[error("cannot write {path}: check the free space and the folder's permissions")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The folder has none of the layouts that are known.
    #[error("{folder} is no capture: {reason}")]
    Layout {
        /// The folder.
        folder: PathBuf,
        /// What was looked for.
        reason: String,
    },
    /// Writing our own layout was broken off: it has pictures but no `capture.json`, which is written last.
    #[error("{folder} was not written to its end (it has no capture.json): make the capture again")]
    Unfinished {
        /// The folder.
        folder: PathBuf,
    },
    /// Something in a file is missing, of another kind than needed or out of range.
    #[error("{file}: `{field}` {reason}")]
    Field {
        /// The file.
        file: PathBuf,
        /// Which part of it: a field's path, a line, a column.
        field: String,
        /// What is wrong with it, and what is needed.
        reason: String,
    },
    /// A picture or mask cannot be used.
    #[error("picture {path} {reason}")]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file of motion cannot be used.
    #[error("cannot use the motion in {path}")]
    Motion {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: MotionError,
    },
    /// A camera is none: the message says which number of it is wrong.
    #[error("camera `{name}`: {reason}")]
    Camera {
        /// The camera's name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The caller asked for what is not there, or handed over what does not fit.
    #[error("{0}")]
    Request(String),
}

impl CaptureError {
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn field(file: &Path, field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.into(),
            reason: reason.into(),
        }
    }

    pub(crate) fn picture(path: &Path, reason: impl Into<String>) -> Self {
        Self::Picture {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }

    pub(crate) fn motion(path: &Path, source: impl Into<MotionError>) -> Self {
        Self::Motion {
            path: path.to_owned(),
            source: source.into(),
        }
    }
}
