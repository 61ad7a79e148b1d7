//! Counting sort on the device: 65,536 bins of 16-bit keys, then exactly by (value, item) within a bin. Where there are
//! so many items that bins would be crowded, keys get up to four bits more; a bin that is crowded all the same, as of many
//! equal values, is counted and scattered once more by the bits that its items differ in.
//!
//! How many items there are is known to the device alone: every pass is dispatched by counts in a buffer. The
//! atomics that fill a bin fall in any order; the last passes make the result the same every time.

use std::mem::offset_of;
use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use renderer_vulkan::timestamps::Timestamps;
use shaders_spirv::{
    CROWDED, ITEMS_PER_PART, QUADS_PER_INSTANCE, SORT_CROWDED, SPAN_BYTES, SortState,
};

use crate::error::RenderError;
use crate::scan::Scan;

/// The least number of bins: 16-bit keys, 30 micrometres each within the 1.5 m that three quarters of them span.
const LEAST_BINS: u32 = 1 << 16;
/// The largest number of bins: more would cost more to add up than they save.
const MOST_BINS: u32 = 1 << 20;
/// Items a bin has on average, once there are more items than this for each of the least bins.
const ITEMS_PER_BIN: u32 = 4;
/// Invocations per workgroup of the passes over items.
const ITEM_GROUP: u32 = 256;

/// The sort's input: buffers that earlier passes fill. Every buffer outlives the passes' use.
#[derive(Clone, Copy)]
pub(crate) struct SortInput<'a> {
    /// `u32` by item: what it is sorted by.
    pub(crate) values: &'a Buffer,
    /// The items, in any order.
    pub(crate) items: &'a Buffer,
    /// A [`SortState`]: how many items, and the range of their values.
    pub(crate) state: &'a Buffer,
    /// The most items there can be.
    pub(crate) capacity: u32,
}

/// The sort's passes.
pub(crate) struct SortPasses {
    gpu: Arc<Gpu>,
    plan: ComputePipeline,
    count: ComputePipeline,
    scan: Scan,
    scatter: ComputePipeline,
    rank: ComputePipeline,
    /// Each with where the state says how many workgroups it has.
    crowded: Vec<(ComputePipeline, usize)>,
    bins: Buffer,
    order: Buffer,
    _placed: [Buffer; 2],
    _crowded: [Buffer; 3],
}

impl SortPasses {
    pub(crate) fn new(gpu: &Arc<Gpu>, input: SortInput<'_>) -> Result<Self, RenderError> {
        // Every pass has to fit one dispatch, which the device sizes by itself.
        let groups = gpu.limits().max_compute_work_group_count[0];
        let limit = groups.saturating_mul(CROWDED + 1);
        if input.capacity > limit {
            return Err(RenderError::TooManyGaussians {
                count: input.capacity as usize,
                limit,
            });
        }
        let bytes = u64::from(input.capacity) * 4;
        let wanted = (input.capacity / ITEMS_PER_BIN).clamp(LEAST_BINS, MOST_BINS);
        let bin_count = wanted.next_power_of_two();
        let bins = Buffer::storage(gpu, "sort bins", u64::from(bin_count) * 4)?;
        let order = Buffer::storage(gpu, "sorted order", bytes)?;
        let placed_values = Buffer::storage(gpu, "placed values", bytes)?;
        let placed_items = Buffer::storage(gpu, "placed items", bytes)?;
        let most_crowded = (input.capacity / (CROWDED + 1)).max(1);
        let crowded_bins = Buffer::storage(gpu, "crowded bins", u64::from(most_crowded) * 4)?;
        // A bin finds its span by where it starts.
        let spans = u64::from(input.capacity / (CROWDED + 1) + 1) * SPAN_BYTES;
        let spans = Buffer::storage(gpu, "spans of crowded bins", spans)?;
        let parts = u64::from(input.capacity / ITEMS_PER_PART + 1) * 4;
        let parts = Buffer::storage(gpu, "parts of crowded bins", parts)?;
        let resources = [
            input.values,
            input.items,
            input.state,
            &bins,
            &placed_values,
            &placed_items,
            &order,
            &crowded_bins,
            &spans,
            &parts,
        ]
        .map(Resource::Storage);
        let make = |shader, constants: &[u32], resources: &[Resource<'_>]| {
            let specialisation = Specialisation {
                constants,
                ..Default::default()
            };
            ComputePipeline::new(gpu, shader, specialisation, resources)
        };
        let by_item = &[ITEM_GROUP][..];
        let crowded = SORT_CROWDED
            .into_iter()
            .map(|(shader, groups)| Ok((make(shader.words, by_item, &resources)?, groups)))
            .collect::<Result<_, VulkanError>>()?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            plan: make(
                shaders_spirv::SORT_PLAN.words,
                &[ITEM_GROUP, QUADS_PER_INSTANCE, bin_count],
                &resources[2..3],
            )?,
            count: make(shaders_spirv::SORT_COUNT.words, by_item, &resources[..4])?,
            scan: Scan::new(gpu, &bins, bin_count)?,
            scatter: make(shaders_spirv::SORT_SCATTER.words, by_item, &resources[..6])?,
            rank: make(shaders_spirv::SORT_RANK.words, by_item, &resources[..8])?,
            crowded,
            bins,
            order,
            _placed: [placed_values, placed_items],
            _crowded: [crowded_bins, spans, parts],
        })
    }

    /// Items, least value first.
    pub(crate) fn order(&self) -> &Buffer {
        &self.order
    }

    /// A buffer for a [`SortState`].
    pub(crate) fn state_buffer(gpu: &Arc<Gpu>) -> Result<Buffer, VulkanError> {
        Buffer::new(
            gpu,
            "sort state",
            size_of::<SortState>() as u64,
            vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            MemoryUsage::Device,
        )
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

    /// Records the sort of the collected items and makes the order visible.
    pub(crate) fn record(&self, commands: vk::CommandBuffer, state: &Buffer) {
        let by_item = offset_of!(SortState, items_groups) as u64;
        let gpu = &self.gpu;
        self.plan.dispatch(commands, &[], [1, 1, 1]);
        barrier(gpu, commands);
        self.count.dispatch_indirect(commands, state, by_item);
        barrier(gpu, commands);
        self.scan.record(commands);
        self.scatter.dispatch_indirect(commands, state, by_item);
        barrier(gpu, commands);
        self.rank.dispatch_indirect(commands, state, by_item);
        barrier(gpu, commands);
        for (pass, groups) in &self.crowded {
            pass.dispatch_indirect(commands, state, *groups as u64);
            barrier(gpu, commands);
        }
    }
}

/// The sort by itself, for keys that the caller gives.
pub struct Sorter {
    // Dropped first: waits for the device.
    commands: Commands,
    passes: SortPasses,
    values: Buffer,
    _items: Buffer,
    state: Buffer,
    order: Buffer,
    timestamps: Option<Timestamps<2>>,
    milliseconds: f64,
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
        let values = Buffer::new(gpu, "sort values", bytes, usage, MemoryUsage::Upload)?;
        let mut items = Buffer::new(gpu, "sort items", bytes, usage, MemoryUsage::Upload)?;
        items.write(&(0..capacity).collect::<Vec<_>>());
        let state = SortPasses::state_buffer(gpu)?;
        let order = Buffer::new(gpu, "sorted order", bytes, usage, MemoryUsage::ReadBack)?;
        let input = SortInput {
            values: &values,
            items: &items,
            state: &state,
            capacity,
        };
        let passes = SortPasses::new(gpu, input)?;
        Ok(Self {
            commands: Commands::new(gpu)?,
            passes,
            timestamps: Timestamps::new(gpu)?,
            milliseconds: 0.0,
            values,
            _items: items,
            state,
            order,
            capacity,
        })
    }

    /// The order that sorts the keys: indices, least key first, equal keys by index.
    ///
    /// # Errors
    /// More keys than the sorter was made for, or a device that fails.
    pub fn sort_keys(&mut self, keys: &[u16]) -> Result<Vec<u32>, RenderError> {
        let values: Vec<u32> = keys.iter().map(|key| u32::from(*key)).collect();
        // The whole 16 bits, none of them fine: a value is its own key.
        let range = SortState {
            least: 0,
            greatest: u32::from(u16::MAX),
            ..SortState::EMPTY
        };
        self.sort(&values, range)
    }

    /// The order that sorts distances as the renderer does: metres, all greater than 0, of the foreground.
    ///
    /// # Errors
    /// As [`Self::sort_keys`].
    pub fn sort_depths(&mut self, metres: &[f32]) -> Result<Vec<u32>, RenderError> {
        let values: Vec<u32> = metres.iter().map(|depth| depth.to_bits()).collect();
        let least = values.iter().copied().min().unwrap_or(u32::MAX);
        let greatest = values.iter().copied().max().unwrap_or_default();
        let range = SortState {
            least,
            greatest,
            fine_least: least,
            fine_greatest: greatest,
            ..SortState::EMPTY
        };
        self.sort(&values, range)
    }

    /// How long the device took for the last sort, all passes; 0 where it has no clock.
    pub fn milliseconds(&self) -> f64 {
        self.milliseconds
    }

    fn sort(&mut self, values: &[u32], range: SortState) -> Result<Vec<u32>, RenderError> {
        let count = u32::try_from(values.len())
            .ok()
            .filter(|count| *count <= self.capacity)
            .ok_or(RenderError::TooManyGaussians {
                count: values.len(),
                limit: self.capacity,
            })?;
        // The device may still be reading the last keys after an error.
        self.commands.wait()?;
        self.values.write(values);
        let start = SortState { count, ..range };
        let (passes, state, order) = (&self.passes, &self.state, &self.order);
        let timestamps = self.timestamps.as_ref();
        let gpu = &passes.gpu;
        self.commands.run("the sort", |commands| {
            if let Some(timestamps) = timestamps {
                timestamps.record_reset(commands);
                timestamps.record_point(commands, 0);
            }
            let words = bytemuck::bytes_of(&start);
            // SAFETY: the command buffer is being recorded; the buffer holds one state.
            unsafe {
                let device = gpu.device();
                device.cmd_update_buffer(commands, state.handle(), 0, words);
            }
            passes.record_clear(commands);
            barrier(gpu, commands);
            passes.record(commands, state);
            if let Some(timestamps) = timestamps {
                timestamps.record_point(commands, 1);
            }
            let region = [vk::BufferCopy::default().size(order.size())];
            // SAFETY: both buffers are as large as the region.
            unsafe {
                let device = gpu.device();
                device.cmd_copy_buffer(commands, passes.order.handle(), order.handle(), &region);
            }
            barrier(gpu, commands);
        })?;
        if let Some(timestamps) = &self.timestamps {
            let [start, end] = timestamps.read()?;
            self.milliseconds = self.passes.gpu.nanoseconds(start, end) * 1e-6;
        }
        Ok(self.order.read(values.len()))
    }
}
