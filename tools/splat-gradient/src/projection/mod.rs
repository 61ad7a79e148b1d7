//! From Gaussians to splats on the picture, and from the derivatives by splats back to those by Gaussians.
//!
//! Zwicker et al., "EWA Splatting" (2001), as the public code of 3DGS has it. The 2x2 covariance is kept as the product of its 2x3
//! root: J W R S, with J the projection's Jacobian, W and R rotations, S the standard deviations.

mod derivatives;
mod seen;
mod splat;

pub(crate) use derivatives::pull_back;
pub(crate) use splat::{ALPHA_CUT_SLACK, LOG2_ALPHA_CUT, MOMENTS, Moments, NEVER, Splat, project};

/// Gaussians that one thread takes at a time. Sums over chunks are taken in their order.
pub(crate) const CHUNK: usize = 1024;
