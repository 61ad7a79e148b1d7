//! People's calls shown on a display: joined, placed in the viewer's room, measured, and left.
//!
//! A [`session::Session`] is given its people ([`participant::Participant`]), each with an avatar and the room or the clip that moves
//! it, and is run on a [`display::Display`]: a headset ([`headset::HeadsetDisplay`]), pictures in memory
//! ([`display::OffscreenDisplay`]), or one of the program's own. It prepares everything, joins the calls only then, and says goodbye at
//! the end.
//!
//! An avatar that performs a clip, drawn at 60 Hz for two seconds:
//!
//! ```no_run
//! use app_pipeline::control::Control;
//! use app_pipeline::placement::InferenceBackends;
//! use app_session::display::{DisplayNeeds, DrawnPicture, LiveSession, OffscreenDisplay, PictureObserver, SessionError, Standpoint};
//! use app_session::participant::{Origin, Participant};
//! use app_session::session::{Session, SessionConfig};
//! use glam::Vec3;
//! use npu_runtime::Runtime;
//! use renderer_splat::{camera::Camera, options::RendererOptions};
//! use renderer_vulkan::gpu::Gpu;
//! use spmm3::{Avatar, LOOP_SECONDS, MotionClip};
//! use std::{sync::Arc, time::{Duration, Instant}};
//!
//! fn front(middle: Vec3) -> Camera {
//!     Camera::look_at(middle + Vec3::new(0.0, 1.4, 3.0), middle + Vec3::Y, Vec3::Y, 0.7, 640, 640)
//! }
//!
//! struct TwoSeconds;
//!
//! impl PictureObserver for TwoSeconds {
//!     fn is_over(&mut self, _: &LiveSession<'_>, first: Option<Instant>) -> Result<bool, SessionError> {
//!         Ok(first.is_some_and(|first| first.elapsed() > Duration::from_secs(2)))
//!     }
//!     fn cameras(&mut self, people: &Standpoint) -> Vec<Camera> {
//!         vec![front(people.floor)]
//!     }
//!     fn drawn(&mut self, picture: DrawnPicture<'_>) -> Result<(), SessionError> {
//!         println!("{} people", picture.people.len());
//!         Ok(())
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let avatar = Arc::new(Avatar::load("me.m3a".as_ref())?);
//! let clip = MotionClip::built_in(&avatar.skeleton, &avatar.expressions, LOOP_SECONDS, 30.0)?;
//! let origin = Origin::Clip { frames: clip.frames, rate_hz: 30.0 };
//! let runtime = Runtime::open(None)?;
//! let config = SessionConfig {
//!     backends: InferenceBackends { runtime: &runtime, threads: 2, compiled: &Default::default() },
//!     placement: Default::default(),
//!     latency: Default::default(),
//!     quality: Default::default(),
//! };
//! let needs = DisplayNeeds {
//!     gpu: Gpu::open(&Default::default(), false)?,
//!     renderer: RendererOptions::new(0, 640, 640, 1),
//!     cameras: vec![front(Vec3::ZERO)],
//!     period: Duration::from_secs(1) / 60,
//! };
//! let session = Session::new(config, vec![Participant { avatar, sits: false, origin }], Control::default());
//! let report = session.run(&mut OffscreenDisplay::new(needs, None, &mut TwoSeconds))?;
//! println!("{} pictures", report.people[0].collector.pictures().count());
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod arrival;
mod at_end;
pub mod attendee;
pub mod call;
pub mod clip;
pub mod display;
pub mod headset;
pub mod overlay;
pub mod own_motion;
pub mod participant;
pub mod pose_queue;
pub mod presence;
pub mod session;

pub use at_end::SetAtEnd;
