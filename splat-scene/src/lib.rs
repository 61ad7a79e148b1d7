//! Static Gaussian scenes, the background behind a person: read from the files that trainers and editors of 3D Gaussian
//! splatting write, checked once, and kept as a structure of arrays in OpenXR's frame. Also the cameras such a
//! scene was trained from. It does not draw, sort or quantise, and knows no device.
//!
//! [`Scene::load`] detects the format by the content: PLY as 3DGS writes it, compressed PLY (PlayCanvas, `SuperSplat`),
//! `.splat` (antimatter15), `.spz` (Niantic, versions 2 to 4) and SOG (`PlayCanvas`, versions 1 and 2). A file's damage is
//! an error; single Gaussians that no renderer could draw are left out and counted ([`Scene::dropped`]).
//!
//! Space: the file's units, x right, y up, z back, as in OpenGL and OpenXR. Files in COLMAP's axes (y down, z forward) are
//! turned by 180 degrees about x when they are read. Where another axis of a file points up, [`Scene::detect_up`] may
//! tell, and [`Scene::turn_up`] turns the scene.

#![forbid(unsafe_code)]

mod axes;
mod bounds;
mod builder;
pub mod cameras;
mod detect;
mod dropped;
mod error;
mod format;
mod frame;
mod limits;
mod load;
mod placement;
mod ply;
mod scene;
mod sh;
mod sog;
mod source;
mod splat;
mod spz;
mod up;

pub use bounds::Bounds;
pub use builder::{MAX_COEFFICIENT, MAX_COORDINATE, MAX_LOG_SCALE, SceneBuilder, Splat};
pub use dropped::Dropped;
pub use error::SceneError;
pub use format::Format;
pub use limits::{MAX_FILE_BYTES, MAX_GAUSSIANS};
pub use placement::Placement;
pub use scene::Scene;
pub use sh::{MAX_SH_DEGREE, SH_C0, ShRotation, rest_coefficients, sh_basis};
pub use sog::is_sog;
pub use up::{DetectedUp, UnknownAxis, UpAxis, UpEvidence};
