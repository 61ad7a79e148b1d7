//! Networks to begin with, where the first avatar's know nothing of the person's clothes yet.
//!
//! A network whose last layer is 0 changes nothing, and yet has derivatives by that layer if the layers before it are not 0: these
//! get random features of the pose, and what they weigh begins at 0. The features are bounded, so that a pose unlike the capture's asks for no more than
//! the capture's own do.

mod attributes;
mod inputs;
mod mesh;
mod pairs;

pub use attributes::{BASES, CONTROLLER_HIDDEN, attribute_network};
pub use inputs::InputStatistics;
pub use mesh::{MESH_FIELDS, MESH_HIDDEN, widened};
pub(crate) use pairs::Pairs;
