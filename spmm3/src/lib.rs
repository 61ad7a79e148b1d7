//! SPMM3, the skinned person model of Mon3tr (paper, section IV): a person's data, and how 215 motion parameters move
//! them. It holds the data and the arithmetic; it does not run networks, draw pictures or talk to a network.
//!
//! A frame's path through this crate: [`MotionParams`] -> [`Skeleton::pose`] -> [`SkinningTransforms`] -> (the deform
//! graph of [`networks`], run elsewhere) -> posed vertices and residuals -> [`BoundGaussians::pose`] -> [`GaussianSet`].
//!
//! Space: metres, y up, the person faces +z and +x is the person's left.
//!
//! A package loaded, and a person posed by the built-in motion:
//!
//! ```no_run
//! use spmm3::{Avatar, Joint, LOOP_SECONDS, MotionClip, Playback};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let avatar = Avatar::load("me.m3a".as_ref())?;
//! println!("{}: {} Gaussians on {} vertices", avatar.name, avatar.gaussians.len(), avatar.template.vertices().len());
//! let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, 30.0)?;
//! for frame in 0..90 {
//!     let motion = clip.sample(f64::from(frame) / 30.0, Playback::Clamp);
//!     let joints = avatar.skeleton.pose(&motion);
//!     println!("the head is at {} m", joints.position(Joint::Head) + motion.root_translation);
//! }
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

mod basis;
mod binding;
mod clip;
mod closest;
mod controllers;
mod cost;
mod error;
mod expression;
mod gaussians;
mod geodesic;
mod importance;
mod joint;
mod motion;
pub mod networks;
pub mod package;
mod range;
mod skeleton;
mod template;

pub use basis::ExpressionBasis;
pub use binding::{BoundGaussians, MOST_SCALE, PlanarVertices, triangle_frame};
pub use clip::{
    LEGS, LOOP_SECONDS, LoadOptions, MotionClip, MotionError, Npz, NpzArray, NpzWriter, Playback,
    at_ease, bend_leg, fit_expression,
};
pub use closest::shares_of_closest;
pub use controllers::{Controllers, NEIGHBOURS};
pub use cost::{CostError, MOST_TILES};
pub use error::PersonError;
pub use expression::{ExpressionPreset, Expressions};
pub use gaussians::{ATTRIBUTES, GaussianSet, SH_C0, attribute};
pub use geodesic::EdgeGraph;
pub use importance::{Importance, KeptLevel};
pub use joint::{JOINTS, Joint};
pub use motion::{BODY, EXPRESSION, HANDS, MotionParams, PARAMS};
pub use package::{Avatar, PackageError};
pub use range::{PoseRange, ROTATIONS};
pub use skeleton::{JointTransforms, Skeleton, SkinningTransforms};
pub use template::{INFLUENCES, SkinWeights, Template};
