//! From one splat scan of a standing person to an avatar that any motion drives.
//!
//! The avatar's Gaussians are the scan's own, bound to a body model that was registered to them; nothing is trained. The order of the
//! work: [`prepare`] (upright, cut out, seen from all sides by networks) -> [`surface`] (depth from many views, what was seen) ->
//! [`body`] (the body model fitted to key points and surface) -> [`bind`] (cleaned Gaussians on triangles, weights, accessories) ->
//! [`shell`] (face, hands, and what was never seen) -> [`finish`] (networks, order of importance, the package).
//!
//! Space, from `prepare` on: metres, y up, the floor at y = 0, the person faces +z and +x is the person's left, as in `spmm3`.

#![forbid(unsafe_code)]

mod apart;
pub mod bind;
pub mod body;
mod conjugate_gradients;
mod error;
pub mod figures;
pub mod finish;
mod median;
mod mesh_depth;
pub mod nearest;
pub mod normals;
pub mod pinhole;
pub mod pipeline;
pub mod points;
pub mod prepare;
pub mod scan;
pub mod shell;
pub mod sight;
pub mod stopwatch;
pub mod surface;
pub mod synthetic;

pub use error::RigError;
