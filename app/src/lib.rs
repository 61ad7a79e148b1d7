//! The receiver: an avatar and motion parameters in, pictures and per-stage times out.
//!
//! A frame's way through this crate: [`Deformer::deform`] (kinematics, deform graph, F_m2g) -> [`pack`] -> the splat
//! renderer, all told to a [`Profile`].

mod bridge;
mod call;
mod deform;
mod error;
mod pack;
mod profile;
mod receiver;

pub use bridge::{Bridge, BridgeState};
pub use call::{Call, CallEnd, CallFigures, Gap, LatencyFigures, Percentiles};
pub use deform::Deformer;
pub use error::ReceiverError;
pub use pack::pack;
pub use profile::{Profile, Stage, StageSummary, Unit};
pub use receiver::Receiver;
