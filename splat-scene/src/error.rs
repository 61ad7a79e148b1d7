//! What can be wrong with a scene's or a camera file.

use std::path::PathBuf;

use crate::Format;

/// Why a scene or its cameras could not be read. Each message names the file, what is wrong with it and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file could not be read at all.
    #[error("cannot read {}; check that it exists, is a file and may be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is larger than any scene this crate reads.
    #[error(
        "{name} has {bytes} bytes, more than the {limit} a scene may have; prune the scene before reading it"
    )]
    TooLarge {
        /// The file.
        name: String,
        /// Its size.
        bytes: u64,
        /// The most that is read.
        limit: u64,
    },
    /// The content is none of the formats.
    #[error(
        "{name} is not a Gaussian scene: {what}; give a .ply (3DGS or compressed), .splat, .spz (version 2 to 4) or .sog file"
    )]
    UnknownFormat {
        /// The file.
        name: String,
        /// What was found instead.
        what: String,
    },
    /// The file is of a known format, but uses a part of it that is not read.
    #[error("{name} ({format}): {what} cannot be read; {advice}")]
    Unsupported {
        /// The file.
        name: String,
        /// Its format.
        format: Format,
        /// The part that is not read.
        what: String,
        /// What to do about it.
        advice: &'static str,
    },
    /// The file ends before what its header promises.
    #[error(
        "{name} ({format}) ends too early: {what} would take {need} bytes, {have} are there; fetch or export it again"
    )]
    Truncated {
        /// The file.
        name: String,
        /// Its format.
        format: Format,
        /// The part that is cut.
        what: String,
        /// The bytes that part needs.
        need: u64,
        /// The bytes left for it.
        have: u64,
    },
    /// The file contradicts itself or its format.
    #[error("{name} ({format}) is damaged: {what}; fetch or export it again")]
    Damaged {
        /// The file.
        name: String,
        /// Its format.
        format: Format,
        /// The contradiction.
        what: String,
    },
    /// More Gaussians than a scene may have.
    #[error(
        "{name} has {count} Gaussians, more than the {limit} a scene may have; prune the scene before reading it"
    )]
    TooManyGaussians {
        /// The file or scene.
        name: String,
        /// How many it says it has.
        count: u64,
        /// The most a scene may have.
        limit: u64,
    },
    /// The machine has no memory for the scene.
    #[error(
        "no memory for a scene of {count} Gaussians of SH degree {sh_degree}; prune it or free memory"
    )]
    OutOfMemory {
        /// The Gaussians of the scene.
        count: usize,
        /// Their SH degree.
        sh_degree: u8,
    },
    /// An SH degree above 3.
    #[error(
        "SH degree {0} is not one of 0, 1, 2 and 3; cut the scene's spherical harmonics to degree 3"
    )]
    ShDegree(u8),
    /// A Gaussian given to a builder with another number of SH coefficients than the scene has.
    #[error(
        "a Gaussian has {got} values beyond SH degree 0 where the scene has {expected}; give 3 for each coefficient"
    )]
    ShRest {
        /// The values given.
        got: usize,
        /// The values each Gaussian of the scene has.
        expected: usize,
    },
    /// A placement that is no scale, rotation and translation.
    #[error("a scene cannot be placed with {what}; {advice}")]
    Placement {
        /// The value that is out of range.
        what: String,
        /// What it may be.
        advice: &'static str,
    },
    /// The camera file is not a list of cameras as 3DGS writes it.
    #[error(
        "{name} is not a list of cameras as 3DGS writes it; give the cameras.json that lies beside the scene"
    )]
    CameraList {
        /// The file.
        name: String,
        /// Where and why it could not be read.
        source: serde_json::Error,
    },
    /// An invalid camera: no size, no focal length, or a matrix that is no rotation.
    #[error("{name}: camera {id}: {what}; correct the camera or write the file again")]
    Camera {
        /// The file.
        name: String,
        /// The camera.
        id: i64,
        /// What is wrong with it.
        what: String,
    },
    /// The file has no camera of that id.
    #[error("{name} has no camera {id}; its cameras are {known}")]
    NoCamera {
        /// The file.
        name: String,
        /// The id asked for.
        id: i64,
        /// The ids there are, in words.
        known: String,
    },
}
