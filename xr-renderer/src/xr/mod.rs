//! A headset through `OpenXR`: finding it, its frames, and showing pictures in it.
//!
//! [`Runtime::load`] finds the loader, [`Headset::open`] the headset and the Vulkan device it wants, [`Session`] shows frames.
//! What goes away with the runtime comes back by being opened again: see [`XrError::is_loss`].

mod copies;
mod direct;
mod error;
pub mod ext;
mod extensions;
mod eyes;
#[cfg(test)]
pub(crate) mod fake;
mod frame;
mod headset;
mod input;
mod layers;
mod panel;
mod pass;
mod pose;
mod runtime;
mod session;
mod space;
mod state;
mod swapchain;
#[cfg(test)]
mod tests;

pub use error::XrError;
pub use extensions::Extensions;
pub use eyes::{Canvas, EyePicture, Surround, Way};
pub use frame::{Eyes, Frame};
pub use headset::{Headset, HeadsetInfo, HeadsetOptions};
pub use input::{Controls, Hand, Input};
pub use panel::PanelImage;
pub use runtime::Runtime;
pub use session::{Happenings, Over, Session, SessionOptions, Tracks};
pub use space::{EYE_HEIGHT, Floor};
pub use state::{Duty, Life, Lifecycle};
