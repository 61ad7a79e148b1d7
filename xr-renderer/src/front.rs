//! The half of drawing that does not care how splats become pixels: upload, project, cull, key, sort.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;
use shaders_spirv::{DROPPED, FrameParams, PackedGaussian, Splat};

use crate::buffer::{Buffer, Place};
use crate::commands::barrier;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::pipeline::{ComputePipeline, Resource, Specialisation};
use crate::sort::SortPasses;

/// Invocations per workgroup.
const GROUP: u32 = 64;

/// Gaussians in, splats of each view and their common order out.
pub(crate) struct Front {
    gpu: Arc<Gpu>,
    project: ComputePipeline,
    sort: SortPasses,
    /// Cameras and sizes, as all stages read them.
    frame: Buffer,
    staging: Buffer,
    /// The staging buffer's copy on the device; where both are the same memory there is none.
    gaussians: Option<Buffer>,
    splats: Buffer,
    rects: Buffer,
    depth_range: Buffer,
    _depths: Buffer,
}

impl Front {
    pub(crate) fn new(gpu: &Arc<Gpu>, max_gaussians: u32, views: u32) -> Result<Self, RenderError> {
        let each = |size: usize| u64::from(max_gaussians) * size as u64;
        let per_view = |size: usize| each(size) * u64::from(views);
        let bytes = each(size_of::<PackedGaussian>());
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let uniform = vk::BufferUsageFlags::UNIFORM_BUFFER;

        let frame = Buffer::new(
            gpu,
            "cameras",
            size_of::<FrameParams>() as u64,
            uniform,
            Place::Upload,
        )?;
        let staging = Buffer::new(gpu, "Gaussians", bytes, storage, Place::Upload)?;
        let gaussians = (!gpu.info().is_cpu)
            .then(|| Buffer::storage(gpu, "Gaussians", bytes))
            .transpose()?;
        let splats = Buffer::storage(gpu, "projected splats", per_view(size_of::<Splat>()))?;
        let rects = Buffer::storage(gpu, "splat rectangles", per_view(4))?;
        let depths = Buffer::storage(gpu, "depths", each(4))?;
        let depth_range = Buffer::storage(gpu, "depth range", 8)?;
        let project = ComputePipeline::new(
            gpu,
            shaders_spirv::PROJECT,
            Specialisation {
                constants: &[GROUP],
                ..Default::default()
            },
            &[
                Resource::Uniform(&frame),
                Resource::Storage(gaussians.as_ref().unwrap_or(&staging)),
                Resource::Storage(&splats),
                Resource::Storage(&rects),
                Resource::Storage(&depths),
                Resource::Storage(&depth_range),
            ],
        )?;
        let sort = SortPasses::new(gpu, max_gaussians, &depths, &depth_range)?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            project,
            sort,
            frame,
            staging,
            gaussians,
            splats,
            rects,
            depth_range,
            _depths: depths,
        })
    }

    pub(crate) fn frame(&self) -> &Buffer {
        &self.frame
    }

    pub(crate) fn splats(&self) -> &Buffer {
        &self.splats
    }

    pub(crate) fn rects(&self) -> &Buffer {
        &self.rects
    }

    pub(crate) fn sort(&self) -> &SortPasses {
        &self.sort
    }

    /// Writes Gaussians to memory the device sees; returns how many milliseconds that took.
    pub(crate) fn write_gaussians(&mut self, gaussians: &[PackedGaussian]) -> f64 {
        let start = Instant::now();
        self.staging.write(gaussians);
        start.elapsed().as_secs_f64() * 1e3
    }

    /// Writes what the stages read of cameras and sizes.
    pub(crate) fn write_frame(&mut self, frame: &FrameParams) {
        self.frame.write(std::slice::from_ref(frame));
    }

    /// Records the copy of `count` Gaussians to the device and the clearing of what is counted into.
    pub(crate) fn record_upload(&self, commands: vk::CommandBuffer, count: u32) {
        let device = self.gpu.device();
        let bytes = u64::from(count) * size_of::<PackedGaussian>() as u64;
        if let Some(gaussians) = self.gaussians.as_ref().filter(|_| count > 0) {
            let region = [vk::BufferCopy::default().size(bytes)];
            // SAFETY: both buffers hold `max_gaussians`, of which `count` are fewer.
            unsafe {
                device.cmd_copy_buffer(
                    commands,
                    self.staging.handle(),
                    gaussians.handle(),
                    &region,
                );
            }
        }
        // SAFETY: the range is 8 bytes long: least, then greatest.
        unsafe {
            device.cmd_fill_buffer(commands, self.depth_range.handle(), 0, 4, DROPPED);
            device.cmd_fill_buffer(commands, self.depth_range.handle(), 4, vk::WHOLE_SIZE, 0);
        }
        self.sort.record_clear(commands);
        barrier(&self.gpu, commands);
    }

    pub(crate) fn record_project(&self, commands: vk::CommandBuffer, count: u32) {
        self.project
            .dispatch(commands, &[], [count.div_ceil(GROUP), 1, 1]);
        barrier(&self.gpu, commands);
    }

    pub(crate) fn record_sort(&self, commands: vk::CommandBuffer, count: u32) {
        self.sort.record(commands, count);
    }
}
