//! Captures of a person: pictures of one to many calibrated, synchronous cameras, with masks and the person's motion where they are there.
//!
//! A capture is a folder. [`Capture::open`] recognises its layout by its files: our own (`capture.json`, written by [`CaptureWriter`]), and those of
//! published data sets. Whatever the layout, it gives cameras in one convention, undistorted pictures and poses of one kind.
//! What is missing (masks, motion) is not made here.
//!
//! Space: metres, y up. A camera's axes are x right, y down, z away from it; the first pixel's centre is at (0.5, 0.5).

#![forbid(unsafe_code)]

mod camera;
mod capture;
mod decode;
mod error;
mod files;
mod held_out;
mod json;
mod layouts;
mod lens;
mod photograph;
mod pose;
mod qualisys;
mod undistort;
mod writer;

pub use camera::{Camera, LARGEST_SIDE, MOST_CAMERAS};
pub use capture::{Capture, MOST_FRAMES};
pub use error::CaptureError;
pub use held_out::HeldOut;
pub use photograph::Photograph;
pub use pose::FramePose;
pub use qualisys::{read_qualisys, upright};
pub use writer::CaptureWriter;
