//! Training an avatar from pictures (paper, sections IV-B and IV-C): a first avatar and a capture become a better avatar.
//!
//! [`Trainer::step`] takes one photograph: the person is posed as in its frame (`avatar-gradient`), drawn as its camera sees
//! (`splat-gradient`), compared, and every parameter moved a little by Adam. [`schedule`] says which parameters learn when and how
//! fast, by the progress of the training alone; this crate has no clock. Gaussians are split, cloned and left out on the way
//! ([`density`]). [`checkpoint`] keeps all state in one file: a training that goes on from it ends with the very bytes of one that was
//! never interrupted, on any number of threads.
//!
//! What makes the first avatar, and what measures the last one on pictures that were kept away, is not here.

#![forbid(unsafe_code)]

mod backdrop;
pub mod checkpoint;
pub mod colour;
pub mod density;
pub mod error;
pub mod fresh;
pub mod options;
pub mod pictures;
pub mod preview;
mod random;
pub mod schedule;
pub mod score;
mod source;
mod trainer;

pub use error::TrainError;
pub use options::Options;
pub use trainer::{StepReport, Trainer, Validation};
