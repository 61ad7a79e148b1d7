//! `mon3tr-dev bench render`: the standard table, or one camera's view of one scene.

use super::render_options::Options;
use super::{scene, standard};
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;

/// Runs `bench render`.
pub(crate) fn run(options: &Options, gpu: &Arc<Gpu>) -> anyhow::Result<()> {
    match &options.scene {
        Some(file) => scene::run(options, file, gpu),
        None => standard::run(options, gpu),
    }
}
