//! Splatting that can be learnt through, on the CPU: pictures of Gaussians, and the derivatives of a loss by every attribute of
//! every Gaussian and by the camera's pose. Other devices do it behind the trait [`SplatDevice`].
//!
//! [`Splatter::draw`] forms pictures as `renderer-splat` does (Kerbl et al., "3D Gaussian Splatting", 2023: EWA projection with
//! 0.3 px^2 on the covariance's diagonal, alpha = min(0.99, opacity exp(-q/2)) cut at 1/255, front to back by depth, display
//! values). [`Drawn::backward`] takes the derivatives of a loss by every pixel and adds those by every attribute to an array of the
//! Gaussians' own layout, so that they flow on into skinning and networks. [`loss`] has the photometric terms of the paper's section
//! IV-C, and [`adam`] the optimiser. The derivatives are written by hand and computed in the processor's own vectors.
//!
//! Everything is a function of its inputs alone: the number of threads does not change a bit, since no sum depends on who was first.
//! What makes Gaussians of a pose, and what is done with their derivatives, is not here.

#![forbid(unsafe_code)]

pub mod adam;
pub mod attributes;
pub mod device;
pub mod error;
pub mod loss;
mod order;
pub mod picture;
mod projection;
mod raster;
mod splatter;
mod tiles;
mod vector;
pub mod view;

pub use attributes::Attributes;
pub use device::SplatDevice;
pub use picture::Picture;
pub use splatter::{Drawn, Splatter};
pub use view::{Twist, View};
