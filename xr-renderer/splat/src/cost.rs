//! What each part of a foreground costs, counted on the device before anything is listed or blended: tiles of its splats' rectangles, at least as many
//! as are listed.
//!
//! A few thousand Gaussians of metres, which fit a file of kilobytes, cover every tile, and no device draws them in time. A picture whose parts cost more
//! than [`MOST_PART_PAIRS`] and [`MOST_FOREGROUND_PAIRS`] allow is not drawn; the caller is told which part costs most, and may draw the others.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};

use crate::error::RenderError;
use crate::limits::{MOST_FOREGROUND_PAIRS, MOST_PART_PAIRS, MOST_PARTS};

/// Two halves of 64 bits for each part; `shaders/costs.glsl`.
const WORDS: usize = 2 * MOST_PARTS;
const BYTES: u64 = (WORDS * size_of::<u32>()) as u64;

/// Counts pairs, and refuses pictures.
pub(crate) struct Costs {
    gpu: Arc<Gpu>,
    /// Counted into by the projection.
    counted: Buffer,
    weigh: ComputePipeline,
    read_back: Buffer,
}

impl Costs {
    /// The counts, to be bound by the projection; [`Self::new`] takes them.
    pub(crate) fn buffer(gpu: &Arc<Gpu>) -> Result<Buffer, VulkanError> {
        Buffer::storage(gpu, "tiles of each part", BYTES)
    }

    /// `state` is a [`SortState`](shaders_spirv::SortState).
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        counted: Buffer,
        state: &Buffer,
    ) -> Result<Self, VulkanError> {
        let resources = [state, &counted].map(Resource::Storage);
        let specialisation = Specialisation {
            constants: &[MOST_PART_PAIRS, MOST_FOREGROUND_PAIRS],
            ..Default::default()
        };
        let words = shaders_spirv::WEIGH.words;
        let none = vk::BufferUsageFlags::empty();
        Ok(Self {
            gpu: Arc::clone(gpu),
            weigh: ComputePipeline::new(gpu, words, specialisation, &resources)?,
            read_back: Buffer::new(
                gpu,
                "tiles of each part",
                BYTES,
                none,
                MemoryUsage::ReadBack,
            )?,
            counted,
        })
    }

    /// Records the clearing, to be made visible before anything is projected.
    pub(crate) fn record_clear(&self, commands: vk::CommandBuffer) {
        // SAFETY: the command buffer is being recorded; the buffer can be a copy's target.
        unsafe {
            let device = self.gpu.device();
            device.cmd_fill_buffer(commands, self.counted.handle(), 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Records the decision whether the picture is drawn, once all counts are visible.
    pub(crate) fn record(&self, commands: vk::CommandBuffer) {
        self.weigh.dispatch(commands, &[], [1, 1, 1]);
        let whole = [vk::BufferCopy {
            src_offset: 0,
            dst_offset: 0,
            size: BYTES,
        }];
        let [from, to] = [&self.counted, &self.read_back].map(Buffer::handle);
        // SAFETY: the command buffer is being recorded; both buffers have as many bytes.
        unsafe {
            self.gpu
                .device()
                .cmd_copy_buffer(commands, from, to, &whole);
        };
        barrier(&self.gpu, commands);
    }

    /// Pairs of each part in the last picture, all views together, as they are or would be. The device is idle.
    pub(crate) fn of_parts(&self) -> [u64; MOST_PARTS] {
        let words: [u32; WORDS] = self.read_back.read_one();
        let mut halves = words.as_chunks::<2>().0.iter();
        std::array::from_fn(|_| {
            let [low, high] = halves.next().copied().unwrap_or_default().map(u64::from);
            low | high << 32
        })
    }

    /// Whether the last picture was drawn. The device is idle.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let parts = self.of_parts();
        let (part, pairs) = dearest(&parts);
        let sum = parts
            .iter()
            .fold(0u64, |sum, part| sum.saturating_add(*part));
        if pairs > MOST_PART_PAIRS.into() {
            return Err(RenderError::CostlyPart {
                part,
                pairs,
                limit: MOST_PART_PAIRS,
            });
        }
        if sum > MOST_FOREGROUND_PAIRS.into() {
            return Err(RenderError::CostlyPart {
                part,
                pairs,
                limit: MOST_FOREGROUND_PAIRS,
            });
        }
        Ok(())
    }
}

/// The part that costs most, the first of those that cost as much, and what it costs.
pub(crate) fn dearest(parts: &[u64; MOST_PARTS]) -> (usize, u64) {
    let mut most = (0, 0);
    for (part, pairs) in parts.iter().enumerate() {
        if *pairs > most.1 {
            most = (part, *pairs);
        }
    }
    most
}
