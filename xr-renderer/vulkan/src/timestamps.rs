//! Timestamp queries that the device writes as it passes them.

use std::sync::Arc;

use ash::vk;

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// Queries from one point to the next: Mesa 25's llvmpipe writes one for each view of a multiview pass.
const SPACING: u32 = 2;

/// A row of points in time, written by the device as it passes them.
#[derive(Debug)]
pub struct Timestamps<const POINTS: usize> {
    gpu: Arc<Gpu>,
    pool: vk::QueryPool,
}

impl<const POINTS: usize> Timestamps<POINTS> {
    /// Nothing where the queue has no clock.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Option<Self>, VulkanError> {
        if gpu.timestamp_bits == 0 {
            return Ok(None);
        }
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(count(POINTS) * SPACING);
        // SAFETY: the structure is complete.
        let pool =
            unsafe { gpu.device().create_query_pool(&info, None) }.during("vkCreateQueryPool")?;
        Ok(Some(Self {
            gpu: Arc::clone(gpu),
            pool,
        }))
    }

    /// Records the reset that must come before the points.
    pub fn record_reset(&self, commands: vk::CommandBuffer) {
        // SAFETY: the command buffer is being recorded, the pool has that many queries.
        unsafe {
            self.gpu
                .device()
                .cmd_reset_query_pool(commands, self.pool, 0, count(POINTS) * SPACING);
        }
    }

    /// Records that all work so far is done.
    pub fn record_point(&self, commands: vk::CommandBuffer, point: usize) {
        debug_assert!(point < POINTS, "point {point} of {POINTS}");
        // SAFETY: as above; the point was reset in this command buffer.
        unsafe {
            self.gpu.device().cmd_write_timestamp(
                commands,
                vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                self.pool,
                count(point) * SPACING,
            );
        }
    }

    /// The device's time at each point, in ticks. It has passed them all.
    ///
    /// # Errors
    /// A device that fails.
    pub fn read(&self) -> Result<[u64; POINTS], VulkanError> {
        let mut ticks = [0u64; POINTS];
        for (point, tick) in (0..).zip(&mut ticks) {
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            let results = std::slice::from_mut(tick);
            // SAFETY: the pool belongs to the device and has that query, which was written.
            unsafe {
                let device = self.gpu.device();
                device.get_query_pool_results(self.pool, point * SPACING, results, flags)
            }
            .during("vkGetQueryPoolResults")?;
        }
        Ok(ticks)
    }
}

impl<const POINTS: usize> Drop for Timestamps<POINTS> {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_query_pool(self.pool, None) };
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a handful of points")]
const fn count(points: usize) -> u32 {
    points as u32
}
