//! A headset through `OpenXR`: finding it, its frames, and showing pictures in it.
//!
//! [`Runtime::load`](runtime::Runtime::load) finds the loader, [`Headset::open`](headset::Headset::open) the headset and the Vulkan device it wants, [`Session`](session::Session) shows frames.
//! What goes away with the runtime comes back by being opened again: see [`XrError::is_loss`](error::XrError::is_loss).

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
