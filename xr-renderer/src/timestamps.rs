//! How long each stage took on the device.

use std::sync::Arc;

use ash::vk;

use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;

/// Milliseconds each stage of the last picture took; 0 for device stages where the queue has no clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Writing the Gaussians to memory that the device reads (host) and copying them there (device).
    pub upload: f64,
    /// Culling, projection into each view, depth keys.
    pub project: f64,
    /// The sort, once for all views.
    pub sort: f64,
    /// Listing the splats of each tile; nothing for quads.
    pub bin: f64,
    /// Blending.
    pub raster: f64,
}

impl StageTimes {
    /// All stages together.
    pub fn total(&self) -> f64 {
        self.upload + self.project + self.sort + self.bin + self.raster
    }
}

/// Queries from one point to the next: Mesa 25's llvmpipe writes one for each view of a multiview pass.
const SPACING: u32 = 2;

/// A row of points in time, written by the device as it passes them.
pub(crate) struct Timestamps<const POINTS: usize> {
    gpu: Arc<Gpu>,
    pool: vk::QueryPool,
}

impl<const POINTS: usize> Timestamps<POINTS> {
    /// Nothing where the queue has no clock.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Option<Self>, RenderError> {
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
    pub(crate) fn record_reset(&self, commands: vk::CommandBuffer) {
        // SAFETY: the command buffer is being recorded, the pool has that many queries.
        unsafe {
            self.gpu
                .device()
                .cmd_reset_query_pool(commands, self.pool, 0, count(POINTS) * SPACING);
        }
    }

    /// Records that all work so far is done.
    pub(crate) fn record_point(&self, commands: vk::CommandBuffer, point: usize) {
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

    /// Milliseconds of each point after the first one. The device has passed them all.
    pub(crate) fn read(&self) -> Result<[f64; POINTS], RenderError> {
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
        let mask = u64::MAX >> (64 - self.gpu.timestamp_bits.min(64));
        let milliseconds = f64::from(self.gpu.limits.timestamp_period) * 1e-6;
        let first = ticks.first().copied().unwrap_or_default();
        #[expect(
            clippy::cast_precision_loss,
            reason = "differences of a frame's length"
        )]
        Ok(ticks.map(|tick| (tick.wrapping_sub(first) & mask) as f64 * milliseconds))
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
