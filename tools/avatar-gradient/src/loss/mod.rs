//! Terms of a loss that look at Gaussians, controllers and vertices (paper, sections IV-A and IV-C). Each is the sum that the paper writes,
//! times `weight`; it is returned, and its derivatives are added to an array of the layout of what it looks at, which
//! [`crate::Model::backward`] takes.
//!
//! A weight must be seen with the sums: of a hundred thousand vertices, or of fifty thousand Gaussians.

mod bind;
mod closest;
mod guide;
mod normals;
mod scale;
mod vertices;

pub use bind::{Share, Surface};
pub use guide::{Pairs, guide};
pub use normals::VertexNormals;
pub use scale::scale;
pub use vertices::vertex_l1;
