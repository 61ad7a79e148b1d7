//! Counting sort on the device: 65,536 bins of 16-bit keys, then exactly by (value, index) within a bin.
//!
//! The atomics that fill a bin fall in any order; the last pass makes the result the same every time.

use std::sync::Arc;

use ash::vk;

use crate::buffer::{Buffer, Place};
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::pipeline::{ComputePipeline, Resource, Specialisation};
use crate::scan::Scan;

const BINS: u32 = 1 << 16;
/// Invocations per workgroup of the simple passes.
const GROUP: u32 = 64;

/// The sort's passes over buffers that someone else fills.
pub(crate) struct SortPasses {
    gpu: Arc<Gpu>,
    count: ComputePipeline,
    scan: Scan,
    scatter: ComputePipeline,
    ties: ComputePipeline,
    bins: Buffer,
    order: Buffer,
}

impl SortPasses {
    /// Sorts indices of `values` (at most `capacity`, each `u32::MAX` or within `range`) where
    /// `range` holds the least and the greatest value. Both buffers outlive the passes' use.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        capacity: u32,
        values: &Buffer,
        range: &Buffer,
    ) -> Result<Self, RenderError> {
        let most = gpu.limits.max_compute_work_group_count[0].saturating_mul(GROUP);
        if capacity > most {
            return Err(RenderError::TooManyGaussians {
                count: capacity as usize,
                limit: most,
            });
        }
        let bins = Buffer::storage(gpu, "sort bins", u64::from(BINS) * 4)?;
        let order = Buffer::storage(gpu, "sorted order", u64::from(capacity) * 4)?;
        let resources = [values, range, &bins, &order].map(Resource::Storage);
        let make = |shader, resources: &[Resource<'_>]| {
            let specialisation = Specialisation {
                constants: &[GROUP],
                push_bytes: 4,
                ..Default::default()
            };
            ComputePipeline::new(gpu, shader, specialisation, resources)
        };
        Ok(Self {
            gpu: Arc::clone(gpu),
            count: make(shaders_spirv::SORT_COUNT, &resources[..3])?,
            scan: Scan::new(gpu, &bins, BINS)?,
            scatter: make(shaders_spirv::SORT_SCATTER, &resources)?,
            ties: make(shaders_spirv::SORT_TIES, &resources)?,
            bins,
            order,
        })
    }

    /// Indices, least value first; dropped ones left out.
    pub(crate) fn order(&self) -> &Buffer {
        &self.order
    }

    /// Ends of the bins in the order; the last is how many indices there are.
    pub(crate) fn bins(&self) -> &Buffer {
        &self.bins
    }

    /// Records the clearing of the bins, to be made visible before [`Self::record`].
    pub(crate) fn record_clear(&self, commands: vk::CommandBuffer) {
        // SAFETY: the command buffer is being recorded; the buffer can be a copy's target.
        unsafe {
            self.gpu
                .device()
                .cmd_fill_buffer(commands, self.bins.handle(), 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Records the sort of the first `count` values and makes the order visible.
    pub(crate) fn record(&self, commands: vk::CommandBuffer, count: u32) {
        let groups = [count.div_ceil(GROUP), 1, 1];
        self.count.dispatch(commands, &[count], groups);
        barrier(&self.gpu, commands);
        self.scan.record(commands);
        self.scatter.dispatch(commands, &[count], groups);
        barrier(&self.gpu, commands);
        self.ties.dispatch(commands, &[count], [BINS / GROUP, 1, 1]);
        barrier(&self.gpu, commands);
    }
}

/// The sort by itself, for keys of the caller's.
pub struct Sorter {
    // Dropped first: waits for the device.
    commands: Commands,
    passes: SortPasses,
    values: Buffer,
    _range: Buffer,
    order: Buffer,
    capacity: u32,
}

impl std::fmt::Debug for Sorter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sorter")
            .field("capacity", &self.capacity)
            .finish_non_exhaustive()
    }
}

impl Sorter {
    /// A sorter for at most `capacity` keys.
    ///
    /// # Errors
    /// Buffers that are too large for the device.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self, RenderError> {
        let bytes = u64::from(capacity) * 4;
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let values = Buffer::new(gpu, "sort values", bytes, usage, Place::Upload)?;
        let mut range = Buffer::new(gpu, "sort range", 8, usage, Place::Upload)?;
        // The whole 16 bits: a value is its own key.
        range.write(&[0, u32::from(u16::MAX)]);
        let order = Buffer::new(gpu, "sorted order", bytes, usage, Place::ReadBack)?;
        Ok(Self {
            commands: Commands::new(gpu)?,
            passes: SortPasses::new(gpu, capacity, &values, &range)?,
            values,
            _range: range,
            order,
            capacity,
        })
    }

    /// The order that sorts the keys: indices, least key first, equal keys by index.
    ///
    /// # Errors
    /// More keys than the sorter was made for, or a device that fails.
    pub fn sort_keys(&mut self, keys: &[u16]) -> Result<Vec<u32>, RenderError> {
        let count = u32::try_from(keys.len())
            .ok()
            .filter(|count| *count <= self.capacity)
            .ok_or(RenderError::TooManyGaussians {
                count: keys.len(),
                limit: self.capacity,
            })?;
        let values: Vec<u32> = keys.iter().map(|key| u32::from(*key)).collect();
        // The device may still be reading the last keys after an error.
        self.commands.settle()?;
        self.values.write(&values);
        let (passes, order) = (&self.passes, &self.order);
        let device = passes.gpu.device();
        self.commands.run("the sort", |commands| {
            passes.record_clear(commands);
            barrier(&passes.gpu, commands);
            passes.record(commands, count);
            let region = [vk::BufferCopy::default().size(order.size())];
            // SAFETY: both buffers are as large as the region.
            unsafe {
                device.cmd_copy_buffer(commands, passes.order.handle(), order.handle(), &region);
            }
            barrier(&passes.gpu, commands);
        })?;
        Ok(self.order.read(keys.len()))
    }

    /// How many keys fit.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }
}
