//! Placing the first person's stages with the renderer that is made for them.

use super::{InferenceBackends, Placed, place};
use crate::control::Control;
use crate::error::ReceiverError;
use crate::plan::{PlacementRequest, Plan};
use crate::posing::{bound_mesh, bound_mesh_with_networks};
use renderer_splat::camera::Camera;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::Avatar;
use std::sync::Arc;

/// Makes a renderer on `gpu` and places the stages of `avatar`, as [`place`]; what only placements that were not chosen need is
/// left out of the renderer.
///
/// # Errors
/// As [`place`], or if the device has no room for the renderer.
pub fn place_first(
    backends: &InferenceBackends<'_>,
    avatar: &Arc<Avatar>,
    gpu: &Arc<Gpu>,
    options: RendererOptions,
    cameras: &[Camera],
    request: PlacementRequest,
    control: &Control,
) -> Result<(Placed, SplatRenderer), ReceiverError> {
    let mesh = match request.plan {
        _ if request.for_several => None,
        None | Some(Plan::GpuAlone) => Some(Arc::new(bound_mesh_with_networks(avatar)?)),
        Some(Plan::Gpu) => Some(Arc::new(bound_mesh(avatar)?)),
        Some(Plan::Npu | Plan::CpuTail | Plan::Cpu) => None,
    };
    let options = RendererOptions {
        mesh,
        interrupt: Some(control.interrupt()),
        ..options
    };
    let new = |options: &RendererOptions| -> Result<_, ReceiverError> {
        Ok(SplatRenderer::new(Arc::clone(gpu), options)?)
    };
    let mut renderer = control.on_gpu(|| new(&options))?;
    let placed = place(backends, avatar, &mut renderer, cameras, request, control)?;
    // 10 MB of the device's memory for networks, 20 for the rest, that are not used.
    let left = match (placed.plan, options.mesh.as_ref()) {
        (Plan::GpuAlone, _) | (_, None) => None,
        (Plan::Gpu, Some(mesh)) if mesh.parameters().is_none() => None,
        (Plan::Gpu, Some(_)) => Some(Some(Arc::new(bound_mesh(avatar)?))),
        (Plan::Npu | Plan::CpuTail | Plan::Cpu, Some(_)) => Some(None),
    };
    if let Some(mesh) = left {
        let options = RendererOptions {
            mesh,
            // The faster one has been found, but for a headset's images, into which each has a way of its own.
            back_end: if gpu.belongs_to_headset() {
                options.back_end
            } else {
                Some(renderer.back_end())
            },
            ..options
        };
        control.on_gpu(|| -> Result<(), ReceiverError> {
            renderer = new(&options)?;
            Ok(())
        })?;
    }
    Ok((placed, renderer))
}
