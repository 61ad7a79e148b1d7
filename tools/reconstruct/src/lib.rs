//! Builds avatars offline (paper, section III-C, with a made-up person in place of a recorded one): a person's meshes, textures and morph targets in; the template, its
//! Gaussians and the networks' training data out. Nothing here runs during a call.

#![forbid(unsafe_code)]

pub mod bake;
mod depth_map;
mod error;
pub mod fit;
pub mod makehuman;
mod part;
mod person;
mod shading;
pub mod simulate;
#[cfg(test)]
mod synthetic;

pub use error::ReconstructError;
pub use part::Part;
pub use person::{
    BareBody, ColouredGaussians, EXPRESSIONS_USED, Person, Texture, build_gaussians,
    expression_basis, shaded_colour,
};
pub use shading::Light;
