//! The half of drawing that both back ends share: upload, posing, culling, projection, depth keys, sort.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use renderer_vulkan::upload::Upload;
use shaders_spirv::{FrameParams, SortState};

use crate::background::{Background, Chunk};
use crate::cost::Costs;
use crate::drawing::{Foreground, Part};
use crate::error::RenderError;
use crate::options::{Filter, RendererOptions};
use crate::order::{SortedForeground, SortedPart};
use crate::parts::Parts;
use crate::posing::{BoundMesh, Interpolation, PosedInput, Posing, StateId};
use crate::shared_buffers::SharedBuffers;
use crate::slot::ForegroundSlot;
use crate::sort::{SortInput, SortPasses};

/// Invocations per workgroup of the background's projection; divides its block.
const GROUP: u32 = 64;

/// From Gaussians to the splats of each view and their common order.
pub(crate) struct GeometryPass {
    gpu: Arc<Gpu>,
    parts: Parts,
    posing: Option<Posing>,
    /// Whether a part is the mesh's Gaussians.
    posed: bool,
    background: Vec<StaticChunk>,
    pub(crate) costs: Costs,
    sort: SortPasses,
    shared: SharedBuffers,
    capacity: u32,
}

/// A part of the background that one set of buffers holds.
struct StaticChunk {
    project: ComputePipeline,
    first: u32,
    count: u32,
    uploads: [Upload; 3],
}

impl GeometryPass {
    pub(crate) fn new(gpu: &Arc<Gpu>, options: &RendererOptions) -> Result<Self, RenderError> {
        let RendererOptions { filter, views, .. } = *options;
        let background = options.background.as_deref();
        let mesh = options.mesh.as_deref();
        let posed = mesh.map_or(0, BoundMesh::gaussians);
        let max_foreground = options.max_foreground.saturating_add(posed);
        let static_count = background.map_or(0, Background::padded_count);
        let most = gpu.limits().max_compute_work_group_count[0].saturating_mul(GROUP);
        let capacity = max_foreground
            .checked_add(static_count)
            .filter(|capacity| *capacity <= most)
            .ok_or(RenderError::TooManyGaussians {
                count: max_foreground as usize + static_count as usize,
                limit: most,
            })?;
        let shared = SharedBuffers::new(gpu, capacity, views)?;
        let counted = Costs::buffer(gpu)?;
        let parts = Parts::new(gpu, options.max_foreground, filter, &shared, &counted)?;
        let posing = mesh.map(|mesh| Posing::new(gpu, mesh)).transpose()?;
        let words = background.map_or(0, Background::harmonics_words);
        let mut chunks = Vec::new();
        let mut first = 0;
        for chunk in background.map_or(&[][..], Background::chunks) {
            let chunk = StaticChunk::new(gpu, chunk, first, words, filter, &shared)?;
            first += chunk.count;
            chunks.push(chunk);
        }
        let input = SortInput {
            values: &shared.depths,
            items: &shared.items,
            state: &shared.state,
            capacity,
        };
        Ok(Self {
            costs: Costs::new(gpu, counted, &shared.state)?,
            sort: SortPasses::new(gpu, input)?,
            gpu: Arc::clone(gpu),
            parts,
            posing,
            posed: false,
            background: chunks,
            shared,
            capacity,
        })
    }

    pub(crate) fn shared_buffers(&self) -> &SharedBuffers {
        &self.shared
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
        self.parts.count()
    }

    /// Gaussians of foreground and background now.
    pub(crate) fn total_count(&self) -> u32 {
        let last = self.background.last();
        self.parts.count() + last.map_or(0, |chunk| chunk.first + chunk.count)
    }

    /// What the order depends on in the foreground.
    pub(crate) fn sorted(&self) -> &SortedForeground {
        self.parts.sorted()
    }

    /// Takes the foreground of the pictures that follow, whose slots fit, as does `own`, the foreground that was set. The device
    /// is idle.
    pub(crate) fn show(
        &mut self,
        parts: &[Part<'_>],
        own: Option<&ForegroundSlot>,
    ) -> Result<(), RenderError> {
        self.posed = false;
        self.parts.begin();
        for part in parts {
            let world_from_part = part.world_from_part;
            match part.gaussians {
                Foreground::Set => {
                    if let Some(own) = own {
                        self.parts.add_slot(own, world_from_part);
                    }
                }
                Foreground::Slot(slot) => self.parts.add_slot(slot, world_from_part),
                Foreground::Posed {
                    from,
                    to,
                    share,
                    level,
                } => {
                    let posing = self.posing.as_mut().ok_or(RenderError::NoMesh)?;
                    posing.show(Interpolation::new(from, to, share, level))?;
                    let sorted =
                        SortedPart::new(posing.count(), posing.motion_bound(), world_from_part);
                    self.parts.add_made(posing.current(), sorted);
                    self.posed = true;
                }
            }
        }
        self.parts.end();
        Ok(())
    }

    /// Takes a pose of the mesh. The device is idle.
    pub(crate) fn push_state(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        let posing = self.posing.as_mut().ok_or(RenderError::NoMesh)?;
        posing.push(input)
    }

    /// The mesh, where its Gaussians are drawn.
    fn posed(&self) -> Option<&Posing> {
        self.posing.as_ref().filter(|_| self.posed)
    }

    /// Writes what the stages read of cameras and sizes.
    pub(crate) fn write_frame(&mut self, frame: &FrameParams) {
        self.shared.frame.write(std::slice::from_ref(frame));
    }

    /// Records the upload of background and mesh, which never change, once.
    pub(crate) fn record_static_upload(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = &self.posing {
            posing.record_mesh(commands);
        }
        for upload in self.background.iter().flat_map(|chunk| &chunk.uploads) {
            upload.record(commands);
        }
        barrier(&self.gpu, commands);
    }

    /// Frees that upload's staging buffers. The device is idle.
    pub(crate) fn static_upload_done(&mut self) {
        if let Some(posing) = &mut self.posing {
            posing.mesh_upload_done();
        }
        let chunks = self.background.iter_mut();
        chunks
            .flat_map(|chunk| &mut chunk.uploads)
            .for_each(Upload::free_staging);
    }

    /// Records the copy of a new foreground to the device and the clearing of what is counted into, by the sort where the picture
    /// sorts.
    pub(crate) fn record_upload(&self, commands: vk::CommandBuffer, sorts: bool) {
        self.parts.record_copies(commands);
        self.costs.record_clear(commands);
        if let Some(posing) = self.posed() {
            posing.record_upload(commands);
        }
        if sorts {
            let empty = bytemuck::bytes_of(&SortState::EMPTY);
            // SAFETY: the command buffer is being recorded; the buffer holds one state.
            unsafe {
                let device = self.gpu.device();
                device.cmd_update_buffer(commands, self.shared.state.handle(), 0, empty);
            }
            self.sort.record_clear(commands);
        }
        barrier(&self.gpu, commands);
    }

    /// Takes note that the picture was drawn, and so its foreground uploaded or posed.
    pub(crate) fn foreground_done(&mut self) {
        self.parts.copies_done();
        if let Some(posing) = self.posing.as_mut().filter(|_| self.posed) {
            posing.picture_done();
        }
    }

    /// Records the networks of new poses, where the device runs them.
    pub(crate) fn record_networks(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_networks(commands);
        }
    }

    /// Records the skinning of new poses, where the foreground is posed.
    pub(crate) fn record_skin(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_skin(commands);
        }
    }

    /// Records the computing of their states.
    pub(crate) fn record_attributes(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_attributes(commands);
        }
    }

    /// Records the computing of the picture's Gaussians.
    pub(crate) fn record_interpolation(&self, commands: vk::CommandBuffer) {
        if let Some(posing) = self.posed() {
            posing.record_interpolation(commands);
        }
    }

    pub(crate) fn record_project(&self, commands: vk::CommandBuffer) {
        self.parts.record_project(commands);
        for chunk in &self.background {
            let push = [chunk.first, chunk.count];
            let groups = [chunk.count.div_ceil(GROUP), 1, 1];
            chunk.project.dispatch(commands, &push, groups);
        }
        barrier(&self.gpu, commands);
        self.costs.record(commands);
    }

    pub(crate) fn record_sort(&self, commands: vk::CommandBuffer) {
        self.sort.record(commands, &self.shared.state);
    }
}

impl StaticChunk {
    fn new(
        gpu: &Arc<Gpu>,
        chunk: &Chunk,
        first: u32,
        harmonics_words: u32,
        filter: Filter,
        shared: &SharedBuffers,
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
            shaders_spirv::PROJECT_BACKGROUND.words,
            specialisation,
            &shared.projecting(&uploads.each_ref().map(Upload::buffer)),
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
