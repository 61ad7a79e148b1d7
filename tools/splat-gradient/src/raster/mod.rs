//! Splats of a tile blended front to back, and what the pixels' derivatives say of each of them.
//!
//! A pixel takes no more splats once less than [`OPAQUE`] shines through it, and a run of eight none once that holds of less than
//! [`STOP`] for all of them. The backward pass goes the same way, with the same arithmetic, so that it sees the same splats; what
//! lies behind a splat is what the pixel shows in the end less what was blended so far.

mod backward;
mod forward;
mod run;

pub(crate) use backward::gather;
pub(crate) use forward::blend;
