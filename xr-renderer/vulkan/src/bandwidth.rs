//! The device's memory bandwidth, to compare a frame's bytes with.

use std::sync::Arc;

use ash::vk;

use crate::buffer::Buffer;
use crate::commands::{Commands, barrier};
use crate::error::VulkanError;
use crate::gpu::Gpu;
use crate::timestamps::Timestamps;

/// Larger than the caches of most devices, and within the range that every device binds.
const BYTES: u64 = 64 << 20;

impl Gpu {
    /// Bytes that the device's own copies move each second, read and written; nothing where it has no clock. Takes
    /// 128 MiB for as long as it runs.
    ///
    /// # Errors
    /// Too little memory, or a device that fails.
    pub fn copy_bandwidth(self: &Arc<Self>) -> Result<Option<f64>, VulkanError> {
        let Some(timestamps) = Timestamps::<2>::new(self)? else {
            return Ok(None);
        };
        let from = Buffer::storage(self, "copy source", BYTES)?;
        let to = Buffer::storage(self, "copy target", BYTES)?;
        // Made last and so dropped first: waits for the device.
        let mut commands = Commands::new(self)?;
        let region = [vk::BufferCopy::default().size(BYTES)];
        let device = self.device();
        commands.run("the copy", |commands| {
            // SAFETY: the command buffer is being recorded; both buffers can be copied and are as large as the region.
            unsafe {
                // Touches all pages of both, so that the copy that counts does not.
                device.cmd_fill_buffer(commands, from.handle(), 0, vk::WHOLE_SIZE, 1);
                device.cmd_fill_buffer(commands, to.handle(), 0, vk::WHOLE_SIZE, 2);
                barrier(self, commands);
                timestamps.record_reset(commands);
                timestamps.record_point(commands, 0);
                device.cmd_copy_buffer(commands, from.handle(), to.handle(), &region);
                barrier(self, commands);
                timestamps.record_point(commands, 1);
            }
        })?;
        let [start, end] = timestamps.read()?;
        let milliseconds = self.nanoseconds(start, end) * 1e-6;
        #[expect(clippy::cast_precision_loss, reason = "exact: a power of two")]
        let moved = 2.0 * BYTES as f64;
        Ok((milliseconds > 0.0).then(|| moved / (milliseconds * 1e-3)))
    }
}
