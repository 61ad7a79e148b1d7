//! What a capture lacks, made: [`Videos`] become pictures, a network makes masks, which what a camera sees without the person
//! brings to the person's outlines, and one fit over all cameras' landmarks makes the motion.
//!
//! [`complete`] does all of it and writes our own layout. [`check`] says what is wrong with a capture; [`draw`] shows it.
//!
//! Nobody but the tracker looks at pictures here, and nobody but `motion-fit` knows a body.

#![forbid(unsafe_code)]

pub mod check;
mod complete;
mod cut_out;
pub mod draw;
mod error;
mod grid;
mod look;
mod matte;
mod motion;
mod pictures;
mod plate;
mod videos;

pub use complete::{Completed, complete};
pub use error::CompletionError;
pub use look::{Look, Networks, look};
pub use matte::refine;
pub use motion::{Motion, fit_motion, view_of};
pub use pictures::{OfCapture, Pictures, Take};
pub use videos::Videos;
