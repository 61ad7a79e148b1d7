//! SPMM3, the skinned person model of Mon3tr (paper, section IV): what a person is and how 215 motion numbers move
//! them. It holds the data and the arithmetic; it does not run networks, draw pictures or talk to a network.
//!
//! A frame's way through this crate: [`MotionParams`] -> [`Skeleton::pose`] -> [`SkinningTransforms`] -> (the deform
//! graph of [`networks`], run elsewhere) -> posed vertices and residuals -> [`BoundGaussians::pose`] -> [`GaussianSet`].
//!
//! Space: metres, y up, the person faces +z and +x is the person's left.

mod binding;
mod clip;
mod controllers;
mod error;
mod expression;
mod gaussians;
mod geodesic;
mod importance;
mod joint;
mod motion;
pub mod networks;
pub mod package;
mod skeleton;
mod template;

pub use binding::{BoundGaussians, PlanarVertices, triangle_frame};
pub use clip::{
    LEGS, LOOP_SECONDS, LoadOptions, MotionClip, MotionError, Playback, at_ease, bend_leg,
};
pub use controllers::{Controllers, NEIGHBOURS};
pub use error::PersonError;
pub use expression::{ExpressionPreset, Expressions};
pub use gaussians::{ATTRIBUTES, GaussianSet, SH_C0, attribute};
pub use geodesic::EdgeGraph;
pub use importance::{Importance, KeptLevel};
pub use joint::{JOINTS, Joint};
pub use motion::{BODY, EXPRESSION, HANDS, MotionParams, PARAMS};
pub use package::{Avatar, PackageError};
pub use skeleton::{JointTransforms, Skeleton, SkinningTransforms};
pub use template::{INFLUENCES, SkinWeights, Template};
