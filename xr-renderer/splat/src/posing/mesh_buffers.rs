//! A [`BoundMesh`] on the device.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::upload::Upload;

use super::bound_mesh::BoundMesh;

/// What never changes, uploaded once.
pub(super) struct MeshBuffers {
    pub(super) units: Buffer,
    pub(super) skin_joints: Upload,
    pub(super) skin_weights: Upload,
    pub(super) bound: Upload,
    pub(super) attributes: Upload,
    pub(super) scales: Upload,
    pub(super) values: Upload,
    pub(super) kept: Upload,
}

impl MeshBuffers {
    pub(super) fn new(gpu: &Arc<Gpu>, mesh: &BoundMesh) -> Result<Self, VulkanError> {
        let uniform = vk::BufferUsageFlags::UNIFORM_BUFFER;
        let bytes = size_of_val(&mesh.units) as u64;
        let mut units = Buffer::new(gpu, "attribute units", bytes, uniform, MemoryUsage::Upload)?;
        units.write(&mesh.units);
        Ok(Self {
            units,
            skin_joints: Upload::new(gpu, "skinning joints", &mesh.skin_joints)?,
            skin_weights: Upload::new(gpu, "skinning weights", &mesh.skin_weights)?,
            bound: Upload::new(gpu, "bound Gaussians", &mesh.bound)?,
            attributes: Upload::new(gpu, "template attributes", &mesh.attributes)?,
            scales: Upload::new(gpu, "scales of the bases", &mesh.scales)?,
            values: Upload::new(gpu, "bases", &mesh.values)?,
            kept: Upload::new(gpu, "levels of detail", &mesh.kept)?,
        })
    }

    /// Records the upload, once.
    pub(super) fn record(&self, commands: vk::CommandBuffer) {
        let uploads = [
            &self.skin_joints,
            &self.skin_weights,
            &self.bound,
            &self.attributes,
            &self.scales,
            &self.values,
            &self.kept,
        ];
        for upload in uploads {
            upload.record(commands);
        }
    }

    /// Frees what only the upload needed. The device is idle and has it all.
    pub(super) fn free_staging(&mut self) {
        let uploads = [
            &mut self.skin_joints,
            &mut self.skin_weights,
            &mut self.bound,
            &mut self.attributes,
            &mut self.scales,
            &mut self.values,
            &mut self.kept,
        ];
        uploads.into_iter().for_each(Upload::free_staging);
    }
}
