//! Placing the first person's stages with the renderer that is made for them.

use super::{InferenceBackends, Placed, place};
use crate::control::Control;
use crate::error::ReceiverError;
use crate::plan::{PlacementRequest, Plan};
use crate::posing::{bound_mesh, bound_mesh_with_networks};
use renderer_splat::camera::Camera;
use renderer_splat::options::RendererOptions;
use renderer_splat::posing::BoundMesh;
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
    // Where it is open, the device may have to do the most that there is.
    let most = request.plan.unwrap_or(Plan::GpuAlone);
    let options = RendererOptions {
        mesh: if request.for_several {
            None
        } else {
            mesh_for(most, avatar)?
        },
        interrupt: Some(control.interrupt()),
        ..options
    };
    let new = |options: &RendererOptions| -> Result<_, ReceiverError> {
        Ok(SplatRenderer::new(Arc::clone(gpu), options)?)
    };
    let mut renderer = control.on_gpu(|| new(&options))?;
    let placed = place(backends, avatar, &mut renderer, cameras, request, control)?;
    // 10 MB of the device's memory for networks, 20 for the rest, that are not used.
    if options.mesh.is_some() && placed.plan != most {
        let options = RendererOptions {
            mesh: mesh_for(placed.plan, avatar)?,
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

/// What a device needs of `avatar` to pose it by `plan`; nothing where it does not pose.
fn mesh_for(plan: Plan, avatar: &Avatar) -> Result<Option<Arc<BoundMesh>>, ReceiverError> {
    Ok(match plan {
        Plan::GpuAlone => Some(Arc::new(bound_mesh_with_networks(avatar)?)),
        Plan::Gpu => Some(Arc::new(bound_mesh(avatar)?)),
        Plan::Npu | Plan::CpuTail | Plan::Cpu => None,
    })
}
