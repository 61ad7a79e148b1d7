//! Draws 3D Gaussians with Vulkan: device, sort, two back ends, read-back.
//!
//! This crate knows Gaussians, not people. [`Gpu::open`] picks a device, [`SplatRenderer`] turns a foreground of
//! [`PackedGaussian`]s, a static [`Background`] and one or two [`Camera`]s into pictures with premultiplied alpha and
//! depth. It needs Vulkan 1.1 with subgroup operations and runs on software drivers (Mesa's lavapipe) as on GPUs.

mod advice;
mod attachment;
mod back_ends;
mod background;
mod bandwidth;
mod bindings;
mod buffer;
mod camera;
mod choice;
mod clock;
mod commands;
mod drawing;
mod engine;
mod error;
mod front;
mod gpu;
mod graphics;
mod images;
mod instance;
mod interrupt;
mod maker;
mod memory;
mod options;
mod order;
mod parts;
mod path;
mod physical;
mod picture;
mod pipeline;
mod posing;
mod present;
mod quads;
mod read_back;
mod render_pass;
mod scan;
mod slot;
mod sort;
mod splat;
mod surface;
mod swapchain;
mod target;
#[cfg(test)]
mod testing;
mod tiles;
mod timestamps;
mod upload;
mod validation;
pub mod xr;

pub use back_ends::BackEndTrial;
pub use background::Background;
pub use camera::{Camera, Fov};
pub use choice::GpuChoice;
pub use drawing::{Drawing, Foreground, MOST_PARTS, Part};
pub use error::RenderError;
pub use gpu::Gpu;
pub use interrupt::Interrupt;
pub use options::{BackEnd, Filter, RendererOptions};
pub use path::{Change, ForegroundPath};
pub use physical::DeviceInfo;
pub use picture::{Backdrop, Image};
pub use posing::{BoundMesh, BoundMeshParts, DetailLevel, PosedInput, Poser, PosingTimes, StateId};
pub use present::{Shown, WindowTarget};
pub use shaders_spirv::{Gaussian, PackedGaussian};
pub use slot::ForegroundSlot;
pub use sort::Sorter;
pub use splat::SplatRenderer;
pub use timestamps::{PictureTime, StageSpans, StageTimes};
