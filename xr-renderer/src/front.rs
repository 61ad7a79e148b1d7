//! The half of drawing that does not care how splats become pixels: upload, project, cull, key, sort.

use std::sync::Arc;

use ash::vk;
use shaders_spirv::{FrameParams, PackedGaussian, SortState, Splat};

use crate::background::{Background, Chunk};
use crate::bindings::Resource;
use crate::buffer::{Buffer, Place};
use crate::commands::barrier;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::options::{Filter, RendererOptions};
use crate::path::ForegroundPath;
use crate::pipeline::{ComputePipeline, Specialisation};
use crate::posing::{Between, BoundMesh, PosedInput, Posing, StateId};
use crate::slot::ForegroundSlot;
use crate::sort::{SortInput, SortPasses};
use crate::upload::Upload;

/// Invocations per workgroup; divides a background's block.
const GROUP: u32 = 64;
/// Where `shaders/project_foreground.comp` binds the Gaussians.
const GAUSSIANS: u32 = 7;

/// Gaussians in, splats of each view and their common order out.
pub(crate) struct Front {
    gpu: Arc<Gpu>,
    foreground: Foreground,
    posing: Option<Posing>,
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
    /// What a slot held, in the device's own memory; next to nothing on a software driver, which reads the slots.
    copy: Buffer,
    /// The slot that is drawn, kept alive while the device may read it.
    slot: Option<Arc<Buffer>>,
    /// Its writing, and the one that the device has.
    writing: u64,
    copied: Option<u64>,
    /// Whether the Gaussians are the mesh's instead.
    posed: bool,
    /// The buffer that is projected.
    projected: vk::Buffer,
    count: u32,
    path: ForegroundPath,
}

/// A part of the background that one set of buffers holds.
struct StaticChunk {
    project: ComputePipeline,
    first: u32,
    count: u32,
    uploads: [Upload; 3],
}

impl Front {
    pub(crate) fn new(gpu: &Arc<Gpu>, options: &RendererOptions) -> Result<Self, RenderError> {
        let RendererOptions { filter, views, .. } = *options;
        let background = options.background.as_deref();
        let mesh = options.mesh.as_deref();
        let max_foreground = options
            .max_foreground
            .max(mesh.map_or(0, BoundMesh::gaussians));
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
        let foreground = Foreground::new(gpu, options.max_foreground, filter, &passed)?;
        let posing = mesh.map(|mesh| Posing::new(gpu, mesh)).transpose()?;
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
            posing,
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

    /// Where on their path the Gaussians of the foreground are now.
    pub(crate) fn foreground_path(&self) -> ForegroundPath {
        self.foreground.path
    }

    /// Takes another foreground, which fits, or none for the pictures that follow. The device is idle.
    pub(crate) fn show(&mut self, slot: Option<&ForegroundSlot>) {
        self.foreground.show(slot, self.gpu.shares_memory);
    }

    /// Takes a pose of the mesh. The device is idle.
    pub(crate) fn push_state(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        let posing = self.posing.as_mut().ok_or(RenderError::NoMesh)?;
        posing.push(input)
    }

    /// Takes the mesh's Gaussians between two states as the foreground of the pictures that follow. The device is idle.
    pub(crate) fn show_posed(&mut self, between: Between) -> Result<(), RenderError> {
        let posing = self.posing.as_mut().ok_or(RenderError::NoMesh)?;
        posing.show(between)?;
        self.foreground.show_posed(posing);
        Ok(())
    }

    /// The mesh, where the foreground is its Gaussians.
    fn posed(&self) -> Option<&Posing> {
        self.posing.as_ref().filter(|_| self.foreground.posed)
    }

    /// Writes what the stages read of cameras and sizes.
    pub(crate) fn write_frame(&mut self, frame: &FrameParams) {
        self.passed.frame.write(std::slice::from_ref(frame));
    }

    /// Records the upload of what never changes, background and mesh, once.
    pub(crate) fn record_once(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = &self.posing {
            posing.record_mesh(commands);
        }
        for upload in self.background.iter().flat_map(|chunk| &chunk.uploads) {
            upload.record(commands);
        }
        barrier(&self.gpu, commands);
    }

    /// Frees what only that upload needed. The device is idle.
    pub(crate) fn once_is_there(&mut self) {
        if let Some(posing) = &mut self.posing {
            posing.mesh_is_there();
        }
        let chunks = self.background.iter_mut();
        chunks
            .flat_map(|chunk| &mut chunk.uploads)
            .for_each(Upload::keep_copy);
    }

    /// Records the copy of a new foreground to the device and, where the picture sorts, the clearing of what is
    /// counted into.
    pub(crate) fn record_upload(&self, commands: vk::CommandBuffer, sorts: bool) {
        let foreground = &self.foreground;
        foreground.record_copy(&self.gpu, commands);
        if let Some(posing) = self.posed() {
            posing.record_upload(commands);
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

    /// Takes note that the picture was drawn, and so its foreground uploaded or posed.
    pub(crate) fn foreground_is_there(&mut self) {
        self.foreground.copied = Some(self.foreground.writing);
        if let Some(posing) = self.posing.as_mut().filter(|_| self.foreground.posed) {
            posing.picture_is_there();
        }
    }

    /// Records the skinning of new poses, where the foreground is posed.
    pub(crate) fn record_skin(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_skin(commands);
        }
    }

    /// Records the making of their states.
    pub(crate) fn record_attributes(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_attributes(commands);
        }
    }

    /// Records the making of the picture's Gaussians.
    pub(crate) fn record_interpolation(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_interpolation(commands);
        }
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
        // Without one the shaders read the slots.
        let copied = if gpu.shares_memory { 0 } else { capacity };
        let bytes = u64::from(copied) * size_of::<PackedGaussian>() as u64;
        let copy = Buffer::storage(gpu, "foreground Gaussians", bytes)?;
        let specialisation = Specialisation {
            constants: &[GROUP, filter.is_mip()],
            ..Default::default()
        };
        let project = ComputePipeline::new(
            gpu,
            shaders_spirv::PROJECT_FOREGROUND,
            specialisation,
            &passed.projecting(&[&copy]),
        )?;
        Ok(Self {
            project,
            projected: copy.handle(),
            copy,
            posed: false,
            slot: None,
            writing: 0,
            copied: None,
            count: 0,
            path: ForegroundPath::NOWHERE,
        })
    }

    fn show(&mut self, slot: Option<&ForegroundSlot>, shaders_read_slots: bool) {
        self.posed = false;
        let Some(slot) = slot else {
            (self.count, self.path) = (0, ForegroundPath::NOWHERE);
            return;
        };
        let memory = slot.memory();
        let held = self.slot.as_ref();
        if held.is_none_or(|held| !Arc::ptr_eq(held, memory)) {
            self.slot = Some(Arc::clone(memory));
            self.copied = None;
        }
        let source = if shaders_read_slots {
            memory
        } else {
            &self.copy
        };
        project(&mut self.project, &mut self.projected, source);
        self.writing = slot.writing;
        (self.count, self.path) = (slot.count, slot.path);
    }

    fn show_posed(&mut self, posing: &Posing) {
        self.posed = true;
        project(&mut self.project, &mut self.projected, posing.present());
        (self.count, self.path) = (posing.count(), posing.path());
    }

    /// Records the copy of what the device has not yet.
    fn record_copy(&self, gpu: &Gpu, commands: vk::CommandBuffer) {
        let news = !self.posed && self.count > 0 && self.copied != Some(self.writing);
        if let (Some(slot), true) = (&self.slot, news && !gpu.shares_memory) {
            let bytes = u64::from(self.count) * size_of::<PackedGaussian>() as u64;
            slot.record_copy(commands, &self.copy, bytes);
        }
    }
}

/// Makes a pass project the Gaussians of another buffer, which outlives its next use. The device is idle.
fn project(pass: &mut ComputePipeline, projected: &mut vk::Buffer, source: &Buffer) {
    if *projected != source.handle() {
        *projected = source.handle();
        pass.rebind(GAUSSIANS, Resource::Storage(source));
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
            Upload::new(gpu, "background Gaussians", &chunk.gaussians)?,
            Upload::new(gpu, "background blocks", &chunk.blocks)?,
            Upload::new(gpu, "background colours", &chunk.harmonics)?,
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
