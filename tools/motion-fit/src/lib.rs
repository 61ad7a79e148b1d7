//! Motion parameters from landmarks or rotations: the avatar's own skeleton, fingers and face fitted to what networks saw in one or more cameras.
//!
//! It knows landmarks and time, but no images, networks or devices.
//!
//! [`MotionFit`] is the whole of it: body, hands and face of one person in one camera's pictures, smoothed. Its parts serve alone,
//! too: [`body`], [`hands`], [`face`], [`smoother`]. [`wearer`] has the same motion of a headset's wearer.
//!
//! ```
//! use glam::Vec2;
//! use motion_fit::landmarks::{Camera, Observation};
//! use motion_fit::{MotionFit, Subject};
//! use spmm3::MotionParams;
//!
//! /// The motion of an avatar that does what was seen, a frame for each picture.
//! fn follow(subject: &Subject<'_>, seen: impl Iterator<Item = Observation>) -> Vec<MotionParams> {
//!     let mut fit = MotionFit::new(subject, Camera::guessed(Vec2::new(1280.0, 720.0)));
//!     let mut motions = Vec::new();
//!     for seen in seen {
//!         let fitted = fit.step(&seen);
//!         if !fitted.sees_person {
//!             println!("{:.2} s: no body is seen, and the pose comes to rest", seen.seconds);
//!         }
//!         motions.push(fitted.motion);
//!     }
//!     motions
//! }
//! ```

#![forbid(unsafe_code)]

pub mod align;
pub mod body;
pub mod calibration;
pub mod face;
pub mod hands;
mod head_only;
pub mod landmarks;
mod motion_fit;
mod recording;
mod rotations;
pub mod smoother;
pub mod wearer;

pub use landmarks::estimates;
pub use motion_fit::{Fitted, MotionFit, Subject, Unsmoothed};
pub use recording::fit_recording;
