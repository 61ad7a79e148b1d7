//! Networks to begin with, where the first avatar's know nothing of the person's clothes yet.
//!
//! A network whose last layer is 0 changes nothing, and yet has derivatives by that layer if the layers before it are not 0: these
//! get random features of the pose, and what they weigh begins at 0.

mod attributes;
mod inputs;
mod mesh;

pub use attributes::{BASES, CONTROLLER_HIDDEN, attribute_network};
pub use inputs::InputStatistics;
pub use mesh::{MESH_FIELDS, MESH_HIDDEN, widened};
