//! A headset through `OpenXR`: finding it, its frames, and showing pictures in it.
//!
//! [`Runtime::load`](runtime::Runtime::load) finds the loader, [`Headset::open`](headset::Headset::open) the headset and the Vulkan
//! device that it wants, [`Session`](session::Session) shows frames. What is lost with the runtime has to be opened again:
//! see [`XrError::is_loss`](error::XrError::is_loss). Each extension is optional: see [`ext`].
//!
//! ```no_run
//! use std::sync::Arc;
//!
//! use renderer_openxr::eyes::Surround;
//! use renderer_openxr::headset::{Headset, HeadsetOptions};
//! use renderer_openxr::runtime::Runtime;
//! use renderer_openxr::session::{Session, SessionOptions};
//! use renderer_splat::drawing::{Drawing, Foreground, Part};
//! use renderer_splat::options::RendererOptions;
//! use renderer_splat::renderer::SplatRenderer;
//!
//! # fn main() -> Result<(), renderer_openxr::error::XrError> {
//! let headset = Headset::open(&Runtime::load()?, HeadsetOptions::default())?;
//! let options = SessionOptions { room: true, read_back: false, display_hz: None };
//! let mut session = Session::new(&headset, options)?;
//! let [width, height] = headset.info().eye_size;
//! let options = RendererOptions::new(60_000, width, height, 2);
//! let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options)?;
//! // renderer.set_foreground(..)
//! while session.poll()?.end.is_none() {
//!     if !session.lifecycle().is_running() {
//!         std::thread::sleep(std::time::Duration::from_millis(10));
//!         continue;
//!     }
//!     let frame = session.wait()?;
//!     let Some(eyes) = session.locate_views(&frame)? else {
//!         session.skip(frame)?;
//!         continue;
//!     };
//!     let mut canvas = session.canvas(&eyes, Surround::Room, false)?;
//!     let foreground = [Part::here(Foreground::Set)];
//!     renderer.draw_onto(&Drawing::new(&eyes.cameras, &foreground), &mut canvas)?;
//!     session.show(frame)?;
//! }
//! # Ok(())
//! # }
//! ```

pub mod canvas;
mod copies;
mod direct;
pub mod error;
pub mod ext;
pub mod extensions;
pub mod eyes;
#[cfg(test)]
mod fake;
pub mod frame;
pub mod headset;
pub mod input;
mod layers;
pub mod panel;
mod pass;
mod pose;
pub mod runtime;
pub mod session;
pub mod space;
pub mod state;
mod swapchain;
#[cfg(test)]
mod tests;
pub mod wearer;
