//! The receiver's lanes: avatars and motion parameters in, pictures and per-stage times out.
//!
//! People go through [`lanes::Lanes`], a thread for each unit. Which unit does what is decided in [`placement`], what each step took is
//! recorded by a [`profile::Collector`]. `app-session` runs lanes for whole calls and for stills; by themselves they want a source of
//! poses and, for each picture, the time at which it is displayed:
//!
//! ```no_run
//! use app_pipeline::compiled_sources::CompiledSources;
//! use app_pipeline::{concealment::ConcealmentState, inference::Inference, plan::Plan, profile::FrameTimes};
//! use app_pipeline::lanes::{DisplayClock, LaneOptions, Lanes, MotionSource, Pose};
//! use glam::Vec3;
//! use npu_runtime::{Provider, Runtime};
//! use renderer_splat::{camera::Camera, options::RendererOptions, renderer::SplatRenderer};
//! use renderer_vulkan::gpu::Gpu;
//! use spmm3::{Avatar, MotionParams, networks::GraphParts};
//! use std::{sync::Arc, time::{Duration, Instant}};
//!
//! /// Stands still.
//! struct Still;
//!
//! impl MotionSource for Still {
//!     fn next(&mut self, longest: Duration) -> Option<Pose> {
//!         std::thread::sleep(longest.min(Duration::from_millis(33)));
//!         let times = FrameTimes::new(ConcealmentState::Live, Instant::now());
//!         Some(Pose { motion: MotionParams::default(), times })
//!     }
//!     fn is_over(&self) -> bool {
//!         false
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let avatar = Arc::new(Avatar::load("me.m3a".as_ref())?);
//! let (runtime, plan) = (Runtime::open(None)?, Plan::CpuTail);
//! let provider = Provider::Cpu { threads: 2 };
//! let inference = Inference::open(&runtime, &avatar, GraphParts::Skinned, &[provider], &CompiledSources::default())?;
//! let gaussians = u32::try_from(avatar.gaussians.len())?;
//! let gpu = Gpu::open(&Default::default(), false)?;
//! let renderer = SplatRenderer::new(gpu, &RendererOptions::new(gaussians, 1024, 1024, 1))?;
//! let mut display = DisplayClock::new(60.0);
//! let (latency, quality) = Default::default();
//! let (display_period, expected_picture) = (display.period(), None);
//! let options = LaneOptions { plan, latency, quality, display_period, expected_picture };
//! let mut lanes = Lanes::start(&avatar, Some(inference), renderer, Still, &options)?;
//! let (eye, target) = (Vec3::new(0.0, 1.4, 3.0), Vec3::new(0.0, 1.0, 0.0));
//! let camera = Camera::look_at(eye, target, Vec3::Y, 0.7, 1024, 1024);
//! loop {
//!     display.wait();
//!     let begun = Instant::now();
//!     if lanes.begin(display.tick(begun))?.is_some() {
//!         lanes.draw(&[camera])?;
//!         lanes.displayed(display.drawn(begun, Instant::now()));
//!         break;
//!     }
//! }
//! println!("{} pixels wide", lanes.renderer().read_back(0)?.width());
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod compiled_sources;
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
pub mod stage;
pub mod timeline;
