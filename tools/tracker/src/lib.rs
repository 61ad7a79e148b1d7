//! A camera's pictures, and networks that see body, hands and face in them at the same time.
//!
//! [`source`] gives pictures of a camera, a video or a folder; [`Tracker`] has the models of [`mediapipe`] (or others, behind the traits
//! in [`models`]) look at each, all at the same time. [`motion_fit`], another crate, makes motion parameters of what they saw.
//!
//! ```no_run
//! use motion_fit::landmarks::Camera;
//! use motion_fit::{MotionFit, Subject};
//! use npu_runtime::Runtime;
//! use std::sync::Arc;
//! use tracker::networks::NetworkSet;
//! use tracker::source::{self, Picture};
//! use tracker::{Tracker, mediapipe};
//!
//! /// `camera` is what the command line takes: `0`, `/dev/video0`, a video file, an address.
//! fn follow(camera: &str, subject: &Subject<'_>) -> Result<(), Box<dyn std::error::Error>> {
//!     let mut source = source::open(&camera.parse()?)?;
//!     let folder = NetworkSet::folder_of_environment()?;
//!     let models = mediapipe::Options::default().load(&folder, &Runtime::open(None)?)?;
//!     let mut tracker = Tracker::new(models)?;
//!     let size = glam::Vec2::new(source.info().width as f32, source.info().height as f32);
//!     let mut fit = MotionFit::new(subject, Camera::guessed(size));
//!     loop {
//!         let mut seen = Picture::empty();
//!         if !source.next(&mut seen)? {
//!             return Ok(());
//!         }
//!         let light = seen.at;
//!         let seen = tracker.observe(&Arc::new(seen))?;
//!         println!("networks: {:.1} ms", seen.times.total_ms);
//!         let fitted = fit.step(&seen.into_observation());
//!         println!("a person: {}, {:.1} ms after the light", fitted.sees_person, light.elapsed().as_secs_f64() * 1e3);
//!     }
//! }
//! ```

pub mod crop;
pub mod custom;
pub mod error;
pub mod mediapipe;
pub mod models;
pub mod networks;
pub mod picture;
pub mod source;
pub mod workers;

pub use error::TrackerError;
pub use workers::Tracker;
