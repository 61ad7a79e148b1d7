//! A capture whose truth is known, for the crates that turn pictures into avatars: the demo person with *simulated* cloth, posed by motion
//! files, drawn as a textured mesh from calibrated cameras.
//!
//! The pictures are made by a mesh rasteriser of its own (perspective-correct textures, z-buffer, 4 x 4 samples a pixel, a shadow map), so
//! that nothing that is trained or measured on them has drawn them itself. Everything depends on the options alone, not on the number of threads.

#![forbid(unsafe_code)]

pub mod draw;
mod error;
pub mod lens;
pub mod model;
pub mod noise;
pub mod performance;
pub mod raster;
pub mod ring;
pub mod shadow;
pub mod sitter;
pub mod synthesise;
pub mod texture;
pub mod truth;

pub use error::SynthesisError;
