//! Ground truth of non-rigid motion: natural poses, and the true shape of the person in each.
//!
//! The paper tracks such meshes from video (section IV-A); we simulate them, quasi-static, so that shape is a function
//! of pose. Nothing here knows of networks.

mod cloth;
mod collide;
mod crease;
mod ground_truth;
mod poses;
mod skinning;
mod surface;
#[cfg(test)]
mod tests;

pub use cloth::{Garment, Settled};
pub use collide::{Capsule, Collider};
pub use crease::{Creases, bulges};
pub(crate) use ground_truth::arm_share;
pub use ground_truth::{Fabric, GroundTruth, Puppet, Simulator, without_root};
pub use poses::PoseSampler;
pub use skinning::PosedSkin;
pub use surface::Surface;
