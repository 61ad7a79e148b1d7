//! The receiver: an avatar and motion parameters in, pictures and per-stage times out.
//!
//! A call's frames go through [`lanes::Lanes`], a thread for each unit; stills go the same way step by step through a
//! [`receiver::Receiver`]. Which unit does what is decided in [`placement`], what each step took is told to a
//! [`profile::Collector`].
//!
//! A still of an avatar, on the CPU's provider and the best Vulkan device:
//!
//! ```no_run
//! use app_pipeline::{deform::Deformer, inference::Inference, plan::Plan, receiver::Receiver};
//! use glam::Vec3;
//! use npu_runtime::{Provider, Runtime};
//! use renderer_splat::{camera::Camera, options::RendererOptions, renderer::SplatRenderer};
//! use renderer_vulkan::gpu::Gpu;
//! use spmm3::{Avatar, MotionParams};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let avatar = Arc::new(Avatar::load("me.m3a".as_ref())?);
//! let (runtime, plan) = (Runtime::open(None)?, Plan::CpuTail);
//! let provider = Provider::Cpu { threads: 2 };
//! let inference = Inference::open(&runtime, &avatar, plan.graph(), &[provider], None)?;
//! let deformer = Deformer::new(&avatar, inference, plan)?;
//! let gpu = Gpu::open(&Default::default(), false)?;
//! let gaussians = u32::try_from(deformer.gaussians())?;
//! let renderer = SplatRenderer::new(gpu, &RendererOptions::new(gaussians, 1024, 1024, 1))?;
//! let mut receiver = Receiver::new(deformer, renderer)?;
//! let (eye, target) = (Vec3::new(0.0, 1.4, 3.0), Vec3::new(0.0, 1.0, 0.0));
//! let camera = Camera::look_at(eye, target, Vec3::Y, 0.7, 1024, 1024);
//! receiver.frame(&MotionParams::default(), &[camera])?;
//! let picture = receiver.renderer().read_back(0)?;
//! println!("{} x {} pixels", picture.width(), picture.height());
//! # Ok(())
//! # }
//! ```

pub mod concealment;
pub mod control;
pub mod deform;
pub mod error;
pub mod inference;
pub mod lanes;
pub mod placement;
pub mod plan;
pub mod pool;
pub mod posing;
pub mod profile;
pub mod quality;
pub mod receiver;
pub mod stage;
pub mod timeline;
