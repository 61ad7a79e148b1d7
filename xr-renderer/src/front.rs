//! The half of drawing that does not care how splats become pixels: upload, project, cull, key, sort.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;
use shaders_spirv::{FrameParams, PackedGaussian, SortState, Splat};

use crate::background::{Background, Chunk};
use crate::bindings::Resource;
use crate::buffer::{Buffer, Place};
use crate::commands::barrier;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::options::Filter;
use crate::pipeline::{ComputePipeline, Specialisation};
use crate::sort::{SortInput, SortPasses};
use crate::upload::Upload;

/// Invocations per workgroup; divides a background's block.
const GROUP: u32 = 64;

/// Gaussians in, splats of each view and their common order out.
pub(crate) struct Front {
    gpu: Arc<Gpu>,
    foreground: Foreground,
    background: Vec<StaticChunk>,
    sort: SortPasses,
    passed: Passed,
    capacity: u32,
}

/// What the passes hand on, to one another and to the back ends.
pub(crate) struct Passed {
    /// Cameras and sizes, as all stages read them.
    pub(crate) frame: Buffer,
    /// The splats of the left (or only) view and of the right one; the latter tiny where there is none.
    pub(crate) splats: [Buffer; 2],
    /// Tiles each splat touches, view after view.
    pub(crate) rects: Buffer,
    /// A [`SortState`].
    pub(crate) state: Buffer,
    depths: Buffer,
    items: Buffer,
}

struct Foreground {
    project: ComputePipeline,
    gaussians: Upload,
    /// Whether the device has not yet what the host wrote.
    stale: bool,
    count: u32,
}

/// A part of the background that one set of buffers holds.
struct StaticChunk {
    project: ComputePipeline,
    first: u32,
    count: u32,
    uploads: [Upload; 3],
}

impl Front {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        max_foreground: u32,
        background: Option<&Background>,
        filter: Filter,
        views: u32,
    ) -> Result<Self, RenderError> {
        let static_count = background.map_or(0, Background::places);
        let most = gpu.limits.max_compute_work_group_count[0].saturating_mul(GROUP);
        let capacity = max_foreground
            .checked_add(static_count)
            .filter(|capacity| *capacity <= most)
            .ok_or(RenderError::TooManyGaussians {
                count: max_foreground as usize + static_count as usize,
                limit: most,
            })?;
        let passed = Passed::new(gpu, capacity, views)?;
        let foreground = Foreground::new(gpu, max_foreground, filter, &passed)?;
        let words = background.map_or(0, Background::harmonics_words);
        let mut chunks = Vec::new();
        let mut first = 0;
        for chunk in background.map_or(&[][..], Background::chunks) {
            let chunk = StaticChunk::new(gpu, chunk, first, words, filter, &passed)?;
            first += chunk.count;
            chunks.push(chunk);
        }
        let input = SortInput {
            values: &passed.depths,
            items: &passed.items,
            state: &passed.state,
            capacity,
        };
        Ok(Self {
            sort: SortPasses::new(gpu, input)?,
            gpu: Arc::clone(gpu),
            foreground,
            background: chunks,
            passed,
            capacity,
        })
    }

    pub(crate) fn passed(&self) -> &Passed {
        &self.passed
    }

    /// All items, least depth first.
    pub(crate) fn order(&self) -> &Buffer {
        self.sort.order()
    }

    /// The most Gaussians there can be.
    pub(crate) fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Gaussians of the foreground now.
    pub(crate) fn foreground_count(&self) -> u32 {
        self.foreground.count
    }

    /// Gaussians of foreground and background now.
    pub(crate) fn total_count(&self) -> u32 {
        let last = self.background.last();
        self.foreground.count + last.map_or(0, |chunk| chunk.first + chunk.count)
    }

    /// Writes the foreground, which fits, to memory the device sees; returns how many milliseconds that took. The
    /// device is idle.
    pub(crate) fn write_foreground(&mut self, gaussians: &[PackedGaussian], count: u32) -> f64 {
        let start = Instant::now();
        self.foreground.gaussians.write(gaussians);
        self.foreground.count = count;
        self.foreground.stale = true;
        start.elapsed().as_secs_f64() * 1e3
    }

    /// Writes what the stages read of cameras and sizes.
    pub(crate) fn write_frame(&mut self, frame: &FrameParams) {
        self.passed.frame.write(std::slice::from_ref(frame));
    }

    /// Records the upload of the background, once.
    pub(crate) fn record_background(&self, commands: vk::CommandBuffer) {
        for upload in self.background.iter().flat_map(|chunk| &chunk.uploads) {
            upload.record(&self.gpu, commands, upload.size());
        }
        barrier(&self.gpu, commands);
    }

    /// Frees what only the background's upload needed. The device is idle.
    pub(crate) fn background_is_there(&mut self) {
        let chunks = self.background.iter_mut();
        chunks
            .flat_map(|chunk| &mut chunk.uploads)
            .for_each(Upload::keep_copy);
    }

    /// Records the copy of a new foreground to the device and, where the picture sorts, the clearing of what is
    /// counted into.
    pub(crate) fn record_upload(&self, commands: vk::CommandBuffer, sorts: bool) {
        let foreground = &self.foreground;
        if foreground.stale && foreground.count > 0 {
            let bytes = u64::from(foreground.count) * size_of::<PackedGaussian>() as u64;
            foreground.gaussians.record(&self.gpu, commands, bytes);
        }
        if sorts {
            let empty = bytemuck::bytes_of(&SortState::EMPTY);
            // SAFETY: the command buffer is being recorded; the buffer holds one state.
            unsafe {
                let device = self.gpu.device();
                device.cmd_update_buffer(commands, self.passed.state.handle(), 0, empty);
            }
            self.sort.record_clear(commands);
        }
        barrier(&self.gpu, commands);
    }

    /// Takes note that the picture was drawn, and so its foreground uploaded.
    pub(crate) fn foreground_is_there(&mut self) {
        self.foreground.stale = false;
    }

    pub(crate) fn record_project(&self, commands: vk::CommandBuffer) {
        let groups = [self.foreground.count.div_ceil(GROUP), 1, 1];
        self.foreground.project.dispatch(commands, &[], groups);
        for chunk in &self.background {
            let push = [chunk.first, chunk.count];
            let groups = [chunk.count.div_ceil(GROUP), 1, 1];
            chunk.project.dispatch(commands, &push, groups);
        }
        barrier(&self.gpu, commands);
    }

    pub(crate) fn record_sort(&self, commands: vk::CommandBuffer) {
        self.sort.record(commands, &self.passed.state);
    }
}

impl Passed {
    fn new(gpu: &Arc<Gpu>, capacity: u32, views: u32) -> Result<Self, RenderError> {
        let each = |size: usize| u64::from(capacity) * size as u64;
        let uniform = vk::BufferUsageFlags::UNIFORM_BUFFER;
        let bytes = size_of::<FrameParams>() as u64;
        let right = if views > 1 {
            each(size_of::<Splat>())
        } else {
            0
        };
        Ok(Self {
            frame: Buffer::new(gpu, "cameras", bytes, uniform, Place::Upload)?,
            splats: [
                Buffer::storage(gpu, "projected splats", each(size_of::<Splat>()))?,
                Buffer::storage(gpu, "projected splats", right)?,
            ],
            rects: Buffer::storage(gpu, "splat rectangles", each(4) * u64::from(views))?,
            state: SortPasses::state_buffer(gpu)?,
            depths: Buffer::storage(gpu, "depths", each(4))?,
            items: Buffer::storage(gpu, "visible Gaussians", each(4))?,
        })
    }

    /// What `shaders/project.glsl` binds, and `more` after it.
    fn projecting<'a>(&'a self, more: &[&'a Buffer]) -> Vec<Resource<'a>> {
        let [left, right] = &self.splats;
        let storage = [
            left,
            right,
            &self.rects,
            &self.depths,
            &self.items,
            &self.state,
        ];
        let storage = storage.into_iter().chain(more.iter().copied());
        std::iter::once(Resource::Uniform(&self.frame))
            .chain(storage.map(Resource::Storage))
            .collect()
    }
}

impl Foreground {
    fn new(
        gpu: &Arc<Gpu>,
        capacity: u32,
        filter: Filter,
        passed: &Passed,
    ) -> Result<Self, RenderError> {
        let bytes = u64::from(capacity) * size_of::<PackedGaussian>() as u64;
        let gaussians = Upload::new(gpu, "foreground Gaussians", bytes)?;
        let specialisation = Specialisation {
            constants: &[GROUP, filter.is_mip()],
            ..Default::default()
        };
        let project = ComputePipeline::new(
            gpu,
            shaders_spirv::PROJECT_FOREGROUND,
            specialisation,
            &passed.projecting(&[gaussians.buffer()]),
        )?;
        Ok(Self {
            project,
            gaussians,
            stale: true,
            count: 0,
        })
    }
}

impl StaticChunk {
    fn new(
        gpu: &Arc<Gpu>,
        chunk: &Chunk,
        first: u32,
        harmonics_words: u32,
        filter: Filter,
        passed: &Passed,
    ) -> Result<Self, RenderError> {
        let uploads = [
            Upload::filled(gpu, "background Gaussians", &chunk.gaussians)?,
            Upload::filled(gpu, "background blocks", &chunk.blocks)?,
            Upload::filled(gpu, "background colours", &chunk.harmonics)?,
        ];
        let specialisation = Specialisation {
            constants: &[GROUP, filter.is_mip(), harmonics_words],
            push_bytes: 8,
            ..Default::default()
        };
        let project = ComputePipeline::new(
            gpu,
            shaders_spirv::PROJECT_BACKGROUND,
            specialisation,
            &passed.projecting(&uploads.each_ref().map(Upload::buffer)),
        )?;
        Ok(Self {
            project,
            first,
            // A scene has at most 4,194,304 Gaussians.
            count: u32::try_from(chunk.gaussians.len()).unwrap_or(u32::MAX),
            uploads,
        })
    }
}
