//! Terms of a loss that look at Gaussians and controllers (paper, section IV-C). Each is the sum that the paper writes,
//! times `weight`; it is returned, and its derivatives are added to an array of the layout of what it looks at, which
//! [`crate::Model::backward`] takes.
//!
//! A weight must be seen with the sums: of fifty thousand Gaussians.

mod bind;
mod guide;
mod scale;

pub use bind::{Share, Surface};
pub use guide::{Pairs, guide};
pub use scale::scale;
