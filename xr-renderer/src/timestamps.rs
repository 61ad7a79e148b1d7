//! How long each stage took on the device, and when that was.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;

use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;

/// Milliseconds each stage of the last picture took; 0 for device stages where the queue has no clock, and for those of
/// posing where the foreground is uploaded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Writing the Gaussians to memory that the device reads (host) and copying them there (device).
    pub upload: f64,
    /// Skinning the meshes of new poses.
    pub skin: f64,
    /// Their Gaussians: attributes, and where those are on the mesh.
    pub attributes: f64,
    /// Gaussians between two states.
    pub interpolate: f64,
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
        let posing = self.skin + self.attributes + self.interpolate;
        self.upload + posing + self.project + self.sort + self.bin + self.raster
    }
}

/// When a picture was drawn, on the host's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureTime {
    /// It was handed to the device.
    pub submitted: Instant,
    /// The host knew that it was done.
    pub finished: Instant,
    /// When the device was at work on it; nothing where its queue has no clock.
    pub stages: Option<StageSpans>,
}

/// When the device began each stage of a picture and ended it, on the host's clock; each begins as the last one ends.
///
/// Lengths are as exact as the device's clock, a microsecond or better. Where all of it lies is known to within
/// [`Self::within`]: some microseconds where the driver compares clocks (`VK_KHR_calibrated_timestamps`); elsewhere half
/// of what is left between submission and first stamp, last stamp and fence, in the pictures so far where that was
/// least. All of it lies between [`PictureTime::submitted`] and [`PictureTime::finished`] in any case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageSpans {
    /// Copying the foreground to the device's memory.
    pub upload: [Instant; 2],
    /// Skinning new poses' meshes; of no length where the foreground is uploaded, as are the next two.
    pub skin: [Instant; 2],
    /// Making states of them.
    pub attributes: [Instant; 2],
    /// The picture's Gaussians between two states.
    pub interpolate: [Instant; 2],
    /// Culling, projection into each view, depth keys.
    pub project: [Instant; 2],
    /// The sort; of no length where the order was kept.
    pub sort: [Instant; 2],
    /// Listing the splats of each tile.
    pub bin: [Instant; 2],
    /// Blending.
    pub raster: [Instant; 2],
    /// How much earlier or later all of it may have been.
    pub within: Duration,
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

    /// The device's time at each point, in ticks. It has passed them all.
    pub(crate) fn read(&self) -> Result<[u64; POINTS], RenderError> {
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
