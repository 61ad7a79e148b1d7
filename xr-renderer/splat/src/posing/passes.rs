//! The passes of posing and the ring of states they fill. Records commands; submits nothing.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::barrier;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use shaders_spirv::PackedGaussian;

use super::bound_mesh::{BoundMesh, LevelRange};
use super::dispatch::{GROUP, word};
use super::input::{Deformation, PosedInput, SlotLayout, StateId};
use super::interpolation::Interpolation;
use super::mesh_buffers::MeshBuffers;
use super::network_passes::{NetworkPasses, Places};
use crate::error::RenderError;
use crate::motion_bound::{Change, MotionBound};

/// States kept: two to draw between, and two that may come meanwhile.
const RING: u32 = 4;
/// Means "all Gaussians, no list"; `ALL` in `shaders/interpolate.comp`.
const ALL: u32 = u32::MAX;
/// Farther than an order is kept for, metres.
const ANYWHERE: f32 = 1.0;
/// Numbers a shader reads at once.
const VECTOR: usize = 4;

/// The number of rings so far, so that no two give a state the same name, even after a device was lost.
static RINGS: AtomicU64 = AtomicU64::new(0);

/// A mesh's poses, states and Gaussians on the device.
pub(crate) struct Posing {
    gpu: Arc<Gpu>,
    networks: Option<NetworkPasses>,
    skin: ComputePipeline,
    attributes: ComputePipeline,
    interpolate: ComputePipeline,
    mesh: MeshBuffers,
    layout: SlotLayout,
    vertices: u32,
    gaussians: u32,
    levels: Vec<LevelRange>,
    inputs: Buffer,
    /// In the device's own memory, unless it has but one.
    inputs_copy: Option<Buffer>,
    posed: Buffer,
    states: Buffer,
    /// The Gaussians of the current picture.
    current: Buffer,
    slots: [Slot; RING as usize],
    /// The state of the current Gaussians, and the one asked for.
    made: Option<Interpolation>,
    wanted: Option<Interpolation>,
    motion: MotionBound,
    /// Unlike that of any other ring, and how many states were pushed here.
    ring: u64,
    pushed: u64,
    /// A slot's start, while it is laid out.
    arranged: Vec<f32>,
}

/// What the host knows of one slot of the ring.
#[derive(Debug, Clone, Copy, Default)]
struct Slot {
    root: [f32; 3],
    /// Whether its input waits to be posed ...
    waits: bool,
    /// ... by the mesh's networks first.
    is_driven: bool,
}

impl Posing {
    pub(crate) fn new(gpu: &Arc<Gpu>, mesh: &BoundMesh) -> Result<Self, RenderError> {
        let most = gpu.limits().max_compute_work_group_count[0].saturating_mul(GROUP);
        if mesh.gaussians.max(mesh.vertices) > most {
            return Err(RenderError::TooManyGaussians {
                count: mesh.gaussians.max(mesh.vertices) as usize,
                limit: most,
            });
        }
        let layout = SlotLayout::of(mesh);
        let input_bytes = u64::from(RING) * (layout.stride() * size_of::<f32>()) as u64;
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let inputs = Buffer::new(gpu, "poses", input_bytes, storage, MemoryUsage::Upload)?;
        let inputs_copy = (!gpu.features().shares_memory)
            .then(|| Buffer::storage(gpu, "poses", input_bytes))
            .transpose()?;
        let posed = u64::from(RING) * u64::from(mesh.vertices) * size_of::<[f32; 4]>() as u64;
        let posed = Buffer::storage(gpu, "posed vertices", posed)?;
        let bytes = u64::from(mesh.gaussians) * size_of::<PackedGaussian>() as u64;
        let states = Buffer::storage(gpu, "posed Gaussians", u64::from(RING) * bytes)?;
        let current = Buffer::storage(gpu, "foreground Gaussians", bytes)?;
        let blocks = mesh.blocks;
        let mesh_buffers = MeshBuffers::new(gpu, mesh)?;

        let poses = Resource::Storage(inputs_copy.as_ref().unwrap_or(&inputs));
        let make = |shader, constants: &[u32], push_bytes, resources: &[Resource<'_>]| {
            let specialisation = Specialisation {
                constants,
                push_bytes,
                ..Default::default()
            };
            ComputePipeline::new(gpu, shader, specialisation, resources)
        };
        let skin = [
            poses,
            poses,
            Resource::Storage(mesh_buffers.skin_joints.buffer()),
            Resource::Storage(mesh_buffers.skin_weights.buffer()),
            Resource::Storage(&posed),
        ];
        let attributes = [
            Resource::Uniform(&mesh_buffers.units),
            poses,
            Resource::Storage(&posed),
            Resource::Storage(mesh_buffers.bound.buffer()),
            Resource::Storage(mesh_buffers.attributes.buffer()),
            Resource::Storage(mesh_buffers.scales.buffer()),
            Resource::Storage(mesh_buffers.values.buffer()),
            Resource::Storage(&states),
        ];
        let interpolate = [
            Resource::Storage(&states),
            Resource::Storage(&current),
            Resource::Storage(mesh_buffers.kept.buffer()),
        ];
        let networks = (mesh.networks.as_ref())
            .map(|networks| {
                let poses = inputs_copy.as_ref().unwrap_or(&inputs);
                NetworkPasses::new(gpu, networks, poses, most)
            })
            .transpose()?;
        Ok(Self {
            networks,
            skin: make(shaders_spirv::POSE_VERTICES.words, &[GROUP], 16, &skin)?,
            attributes: make(
                shaders_spirv::POSE_GAUSSIANS.words,
                &[GROUP, blocks],
                28,
                &attributes,
            )?,
            interpolate: make(shaders_spirv::INTERPOLATE.words, &[GROUP], 20, &interpolate)?,
            gpu: Arc::clone(gpu),
            mesh: mesh_buffers,
            arranged: vec![0.0; layout.vertices()],
            layout,
            vertices: mesh.vertices,
            gaussians: mesh.gaussians,
            levels: mesh.levels.clone(),
            inputs,
            inputs_copy,
            posed,
            states,
            current,
            slots: [Slot::default(); RING as usize],
            made: None,
            wanted: None,
            motion: MotionBound::new(),
            ring: RINGS.fetch_add(1, Ordering::Relaxed),
            pushed: 0,
        })
    }

    /// Records the mesh's upload, once.
    pub(crate) fn record_mesh(&self, commands: vk::CommandBuffer) {
        self.mesh.record(commands);
        if let Some(networks) = &self.networks {
            networks.record_upload(commands);
        }
        barrier(&self.gpu, commands);
    }

    /// Frees what only the mesh's upload needed. The device is idle.
    pub(crate) fn mesh_upload_done(&mut self) {
        self.mesh.free_staging();
        if let Some(networks) = &mut self.networks {
            networks.free_staging();
        }
    }

    /// Writes a pose over the oldest one; the device is not reading it.
    pub(crate) fn push(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        self.layout.check(input)?;
        let id = StateId {
            ring: self.ring,
            number: self.pushed,
        };
        let index = slot_index(id);
        let arranged = self.layout.arrange(input, &mut self.arranged);
        let first = index as usize * self.layout.stride();
        (self.inputs).write_at(first, self.arranged.get(..arranged).unwrap_or_default());
        let is_driven = match input.deformation {
            Deformation::Computed {
                canonical_vertices, ..
            } => {
                let vertices = first + self.layout.vertices();
                self.inputs.write_at(vertices, canonical_vertices);
                false
            }
            Deformation::Parameters(_) => true,
        };
        if let Some(slot) = self.slots.get_mut(index as usize) {
            *slot = Slot {
                root: input.root,
                waits: true,
                is_driven,
            };
        }
        self.pushed += 1;
        Ok(id)
    }

    /// Refuses a state that was never pushed here, or before the last four.
    pub(super) fn check_kept(&self, id: StateId) -> Result<(), RenderError> {
        let kept = self.pushed.saturating_sub(u64::from(RING))..self.pushed;
        if id.ring == self.ring && kept.contains(&id.number) {
            Ok(())
        } else {
            Err(RenderError::NoState)
        }
    }

    /// Records the copies of new poses to the device.
    pub(crate) fn record_upload(&self, commands: vk::CommandBuffer) {
        let Some(copy) = &self.inputs_copy else {
            return;
        };
        let bytes = |numbers: usize| (numbers * size_of::<f32>()) as u64;
        for (index, slot) in self.waiting() {
            let offset = u64::from(index) * bytes(self.layout.stride());
            let region = [vk::BufferCopy {
                src_offset: offset,
                dst_offset: offset,
                // The device writes the rest itself.
                size: bytes(if slot.is_driven {
                    self.layout.potentials()
                } else {
                    self.layout.stride()
                }),
            }];
            // SAFETY: the command buffer is being recorded; both buffers hold as many slots.
            unsafe {
                let device = self.gpu.device();
                device.cmd_copy_buffer(commands, self.inputs.handle(), copy.handle(), &region);
            }
        }
        barrier(&self.gpu, commands);
    }

    /// Records the networks of new poses that came as parameters.
    pub(crate) fn record_networks(&self, commands: vk::CommandBuffer) {
        let Some(networks) = &self.networks else {
            return;
        };
        for (index, _) in self.waiting().filter(|(_, slot)| slot.is_driven) {
            let first = index as usize * self.layout.stride();
            networks.record(
                commands,
                Places {
                    parameters: first + self.layout.parameters(),
                    potentials: first + self.layout.potentials(),
                    vertices: first + self.layout.vertices(),
                },
            );
        }
    }

    /// Records the skinning of new poses' meshes.
    pub(crate) fn record_skin(&self, commands: vk::CommandBuffer) {
        let groups = [self.vertices.div_ceil(GROUP), 1, 1];
        for (index, _) in self.waiting() {
            let first = index as usize * self.layout.stride();
            let push = [
                self.vertices,
                word(first / VECTOR),
                word(first + self.layout.vertices()),
                index * self.vertices,
            ];
            self.skin.dispatch(commands, &push, groups);
        }
        barrier(&self.gpu, commands);
    }

    /// Records the posing of new poses' Gaussians, once their meshes are skinned.
    pub(crate) fn record_attributes(&self, commands: vk::CommandBuffer) {
        let groups = [self.gaussians.div_ceil(GROUP), 1, 1];
        for (index, slot) in self.waiting() {
            let first = index as usize * self.layout.stride();
            let [x, y, z] = slot.root.map(f32::to_bits);
            let push = [
                self.gaussians,
                word((first + self.layout.potentials()) / VECTOR),
                index * self.vertices,
                index * self.gaussians,
                x,
                y,
                z,
            ];
            self.attributes.dispatch(commands, &push, groups);
        }
        barrier(&self.gpu, commands);
    }

    /// Sets the states, kept in the ring, that the current Gaussians are interpolated from.
    pub(crate) fn show(&mut self, between: Interpolation) -> Result<(), RenderError> {
        self.check_kept(between.from)?;
        self.check_kept(between.to)?;
        if self.wanted != Some(between) {
            self.wanted = Some(between);
            // How far they moved is known to the device alone.
            self.motion.advance(Change {
                metres: ANYWHERE,
                ..Change::default()
            });
        }
        Ok(())
    }

    /// Records the current Gaussians, unless they are there already.
    pub(crate) fn record_interpolation(&self, commands: vk::CommandBuffer) {
        let Some(between) = self.wanted.filter(|_| self.made != self.wanted) else {
            return;
        };
        let level = self.level(between.level);
        let push = [
            level.count,
            slot_index(between.from) * self.gaussians,
            slot_index(between.to) * self.gaussians,
            between.share.to_bits(),
            level.first,
        ];
        let groups = [level.count.div_ceil(GROUP), 1, 1];
        self.interpolate.dispatch(commands, &push, groups);
        barrier(&self.gpu, commands);
    }

    /// Takes note that the device has made the current Gaussians, and so states of all poses.
    pub(crate) fn picture_done(&mut self) {
        self.states_done();
        self.made = self.wanted;
    }

    /// Takes note that the device has made states of all poses.
    pub(super) fn states_done(&mut self) {
        for slot in &mut self.slots {
            slot.waits = false;
        }
    }

    /// How far the current Gaussians have moved.
    pub(crate) fn motion_bound(&self) -> MotionBound {
        self.motion
    }

    /// Number of current Gaussians.
    pub(crate) fn count(&self) -> u32 {
        let level = self.wanted.map_or(0, |between| between.level);
        self.level(level).count
    }

    /// A level of detail; of those beyond the last, the last.
    fn level(&self, number: usize) -> LevelRange {
        let all = LevelRange {
            first: ALL,
            count: self.gaussians,
        };
        let last = self.levels.last().copied().unwrap_or(all);
        match number.checked_sub(1) {
            None => all,
            Some(index) => self.levels.get(index).copied().unwrap_or(last),
        }
    }

    /// The Gaussians of the current picture.
    pub(crate) fn current(&self) -> &Buffer {
        &self.current
    }

    /// A state's posed vertices, as four numbers each, and where they begin.
    pub(super) fn posed(&self, id: StateId) -> (&Buffer, u64) {
        let bytes = u64::from(self.vertices) * size_of::<[f32; 4]>() as u64;
        (&self.posed, u64::from(slot_index(id)) * bytes)
    }

    /// A state's Gaussians, and where they begin.
    pub(super) fn state(&self, id: StateId) -> (&Buffer, u64) {
        let bytes = u64::from(self.gaussians) * size_of::<PackedGaussian>() as u64;
        (&self.states, u64::from(slot_index(id)) * bytes)
    }

    /// Records the copy of a buffer from `offset` on, as much as `target` holds and there is.
    pub(super) fn record_copy(
        &self,
        commands: vk::CommandBuffer,
        source: &Buffer,
        offset: u64,
        target: &Buffer,
    ) {
        let size = target.size().min(source.size() - offset);
        let region = [vk::BufferCopy::default().src_offset(offset).size(size)];
        // SAFETY: the command buffer is being recorded; both buffers hold as much.
        unsafe {
            let device = self.gpu.device();
            device.cmd_copy_buffer(commands, source.handle(), target.handle(), &region);
        }
        barrier(&self.gpu, commands);
    }

    fn waiting(&self) -> impl Iterator<Item = (u32, &Slot)> {
        (0..).zip(&self.slots).filter(|(_, slot)| slot.waits)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "below the ring's size")]
fn slot_index(id: StateId) -> u32 {
    (id.number % u64::from(RING)) as u32
}
