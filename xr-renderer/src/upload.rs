//! What the host writes and shaders read: on a GPU through a copy in the device's own memory.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use crate::buffer::{Buffer, Place};
use crate::error::RenderError;
use crate::gpu::Gpu;

/// A storage buffer that the host writes and, unless the device is a software driver with but one memory, its copy.
pub(crate) struct Upload {
    staging: Buffer,
    copy: Option<Buffer>,
}

impl Upload {
    pub(crate) fn new(gpu: &Arc<Gpu>, what: &'static str, bytes: u64) -> Result<Self, RenderError> {
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        Ok(Self {
            staging: Buffer::new(gpu, what, bytes, storage, Place::Upload)?,
            copy: (!gpu.info().is_cpu)
                .then(|| Buffer::storage(gpu, what, bytes))
                .transpose()?,
        })
    }

    /// As large as the values, and holding them on the host's side.
    pub(crate) fn filled<T: Pod>(
        gpu: &Arc<Gpu>,
        what: &'static str,
        values: &[T],
    ) -> Result<Self, RenderError> {
        let mut upload = Self::new(gpu, what, size_of_val(values) as u64)?;
        upload.write(values);
        Ok(upload)
    }

    /// Writes values, which fit, on the host's side. The device is idle.
    pub(crate) fn write<T: Pod>(&mut self, values: &[T]) {
        self.staging.write(values);
    }

    /// What shaders bind.
    pub(crate) fn buffer(&self) -> &Buffer {
        self.copy.as_ref().unwrap_or(&self.staging)
    }

    /// Bytes there is room for.
    pub(crate) fn size(&self) -> u64 {
        self.staging.size()
    }

    /// Records the copy of the first bytes, more than none, where there is one to be made.
    pub(crate) fn record(&self, gpu: &Gpu, commands: vk::CommandBuffer, bytes: u64) {
        let Some(copy) = &self.copy else { return };
        let region = [vk::BufferCopy::default().size(bytes)];
        // SAFETY: the command buffer is being recorded; both buffers hold as many bytes.
        unsafe {
            let device = gpu.device();
            device.cmd_copy_buffer(commands, self.staging.handle(), copy.handle(), &region);
        }
    }

    /// Frees the host's side of what is not written again. The device is idle and has the copy.
    pub(crate) fn keep_copy(&mut self) {
        if let Some(copy) = self.copy.take() {
            self.staging = copy;
        }
    }
}
