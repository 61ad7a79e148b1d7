//! What can be wrong with a motion file. Each message is one line that ends with what to do; a cause is the error's
//! `source` and not repeated in its text.

use std::path::PathBuf;

/// A motion file that cannot be used, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The file could not be read.
    #[error("cannot read the motion file {path}: check the path and its permissions")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A folder was given.
    #[error("{path} is a folder: give a .bvh or .npz file in it")]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// The file is of no kind that this module reads.
    #[error(
        "{path} is neither a BVH text (it would begin with HIERARCHY) nor an SMPL-X .npz archive: {hint}"
    )]
    Kind {
        /// The file.
        path: PathBuf,
        /// What to do instead.
        hint: &'static str,
    },
    /// The file is larger than any clip may be.
    #[error(
        "{what} is {size}, above the limit of {limit}: cut the clip into shorter ones or lower its frame rate"
    )]
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// How large it is.
        size: u64,
        /// How large it may be.
        limit: u64,
    },
    /// The BVH text breaks the format.
    #[error("BVH line {line}: {reason}; correct that line or export the file again")]
    Bvh {
        /// Line in the file, from 1.
        line: usize,
        /// What is wrong there.
        reason: String,
    },
    /// The BVH's joints do not make a person that SMPL-X's skeleton could follow.
    #[error(
        "the BVH has no {missing} that I know by name; I know the names of CMU/MotionBuilder, Mixamo and MakeHuman, \
         and found {found}: rename the joints or export with one of those skeletons"
    )]
    Skeleton {
        /// What is missing, in words.
        missing: String,
        /// Some of the joint names found.
        found: String,
    },
    /// The archive is not a readable zip.
    #[error("the .npz archive is damaged: export it again with numpy.savez")]
    Archive(#[from] zip::result::ZipError),
    /// An array of the archive is missing, damaged or of the wrong shape.
    #[error("array `{array}` of the .npz {reason}; correct it and save it again with numpy.savez")]
    Array {
        /// Name of the array.
        array: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A number of a frame is outside what a person's motion can have.
    #[error(
        "frame {frame}: {what} is {value:e}, beyond the {limit} that are possible: check the file's units or export it again"
    )]
    Range {
        /// The frame, from 0.
        frame: usize,
        /// Which of its numbers, with its unit.
        what: String,
        /// Its value.
        value: f32,
        /// The largest possible absolute value.
        limit: f32,
    },
    /// The caller asked for an impossible clip.
    #[error("{0}")]
    Request(String),
}

impl MotionError {
    pub(super) fn bvh(line: usize, reason: impl Into<String>) -> Self {
        Self::Bvh {
            line,
            reason: reason.into(),
        }
    }

    pub(super) fn array(array: &str, reason: impl Into<String>) -> Self {
        Self::Array {
            array: array.to_owned(),
            reason: reason.into(),
        }
    }
}
