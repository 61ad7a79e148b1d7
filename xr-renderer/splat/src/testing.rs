//! Shared by this crate's own tests.

use std::sync::Arc;

use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;

/// The device that `MON3TR_GPU` names; nothing, where there is none and CI does not demand one.
pub(crate) fn open_gpu() -> Option<Arc<Gpu>> {
    let name = std::env::var("MON3TR_GPU").unwrap_or_default();
    let choice: GpuChoice = name.parse().expect("any text is a choice");
    match Gpu::open(&choice, true) {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no Vulkan device: {why}"
            );
            println!("skipped: no Vulkan device: {why}");
            None
        }
    }
}
