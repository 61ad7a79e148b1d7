//! The body: the avatar's skeleton fitted to landmarks.
//!
//! [`fit::BodyFit`] follows one body in one camera's pictures. Its inner parts serve other sources, too: [`solver::SkeletonSolver`] bends a
//! [`chain::Chain`] to any set of [`terms::Term`]s, in f64. [`several::fit`] fits a whole recording of several calibrated cameras.

mod bindings;
pub mod chain;
mod contact;
mod evidence;
pub mod fit;
pub mod foot_lock;
mod labels;
mod lengths;
mod limits;
mod pose;
pub mod prior;
mod prior_table;
mod proportions;
mod reading;
pub mod several;
pub mod so3;
mod soles;
pub mod solver;
mod stances;
mod standing;
pub mod terms;
mod track;
mod triangulate;
mod upright;

pub use bindings::landmark_places;
pub use evidence::Parts;
pub use fit::{BodyFit, FitConfig};
pub use foot_lock::FootLock;
pub use pose::{BodyPose, CameraPose, Limb};
pub(crate) use reading::upright_axes;
pub(crate) use soles::soles;
pub use standing::Calibration;
pub(crate) use standing::StandingBody;
pub use triangulate::{Located, LocatedBody, triangulate};
