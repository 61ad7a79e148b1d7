//! A buffer that the host writes once and shaders read: on a GPU, through a copy in the device's own memory.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use crate::buffer::{Buffer, MemoryUsage};
use crate::error::VulkanError;
use crate::gpu::Gpu;

/// A storage buffer that the host writes and, unless the device is a software driver with but one memory, its copy.
#[derive(Debug)]
pub struct Upload {
    staging: Buffer,
    copy: Option<Buffer>,
}

impl Upload {
    /// As large as the values, and holding them on the host's side.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn new<T: Pod>(
        gpu: &Arc<Gpu>,
        what: &'static str,
        values: &[T],
    ) -> Result<Self, VulkanError> {
        let bytes = size_of_val(values) as u64;
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut staging = Buffer::new(gpu, what, bytes, storage, MemoryUsage::Upload)?;
        staging.write(values);
        let copy = (!gpu.features().shares_memory)
            .then(|| Buffer::storage(gpu, what, bytes))
            .transpose()?;
        Ok(Self { staging, copy })
    }

    /// What shaders bind.
    pub fn buffer(&self) -> &Buffer {
        self.copy.as_ref().unwrap_or(&self.staging)
    }

    /// Records the copy, where one is needed.
    pub fn record(&self, commands: vk::CommandBuffer) {
        if let Some(copy) = &self.copy {
            self.staging
                .record_copy(commands, copy, self.staging.size());
        }
    }

    /// Frees the host's buffer, which is not written again. The device is idle and has the copy.
    pub fn free_staging(&mut self) {
        if let Some(copy) = self.copy.take() {
            self.staging = copy;
        }
    }
}
