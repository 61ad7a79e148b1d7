//! The device's memory: buffers for so many Gaussians, pixels and pairs of tile and splat.

use ash::vk;
use bytemuck::Pod;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{CROWDED, ITEMS_PER_PART, SCAN_BLOCK, SPAN_BYTES, SortState, TILE_PIXELS};
use splat_gradient::attributes::ATTRIBUTES;
use splat_gradient::picture::CHANNELS;
use std::sync::Arc;

/// Gaussians that a workgroup takes; `local_size_x` in `shaders/seen.glsl`.
pub(crate) const GROUP: usize = 64;
/// Keys of the depth sort: 16 bits.
pub(crate) const BINS: u32 = 1 << 16;
/// Numbers in `Splat` of `shaders/numbers.glsl`.
const SPLAT: u64 = 11;
/// `MOMENTS` of `shaders/numbers.glsl`.
const MOMENTS: u64 = 9;
/// Numbers in a twist.
const TWIST: u64 = 6;
/// Bytes of a number.
const WORD: u64 = 4;
/// The most bytes of the table that lists are counted in.
const TABLE_BYTES: u64 = 64 << 20;

/// How much there is room for, or has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Room {
    pub(crate) gaussians: u64,
    pub(crate) pixels: u64,
    pub(crate) tiles: u64,
    /// Of tile and splat.
    pub(crate) pairs: u64,
}

impl Room {
    /// For one Gaussian in a picture of one pixel.
    pub(crate) const LEAST: Self = Self {
        gaussians: 1,
        pixels: 1,
        tiles: 1,
        pairs: 4,
    };

    /// For a picture of `count` Gaussians; how many pairs there will be is not known before it is drawn.
    pub(crate) fn of(count: u64, [width, height]: [u64; 2]) -> Self {
        let side = u64::from(TILE_PIXELS);
        Self {
            gaussians: count,
            pixels: width * height,
            tiles: width.div_ceil(side) * height.div_ceil(side),
            pairs: 4 * count,
        }
    }

    /// As much of each as either has; where `wanted` is more and it is to be `roomy`, a quarter more than that, since what grows will go on.
    pub(crate) fn grown(&self, wanted: &Self, roomy: bool) -> Self {
        let grown = |has: u64, wanted: u64| match wanted > has {
            true if roomy => wanted.saturating_add(wanted / 4),
            true => wanted,
            false => has,
        };
        Self {
            gaussians: grown(self.gaussians, wanted.gaussians),
            pixels: grown(self.pixels, wanted.pixels),
            tiles: grown(self.tiles, wanted.tiles),
            pairs: grown(self.pairs, wanted.pairs),
        }
    }

    /// Whether this is enough where `wanted` is.
    pub(crate) fn holds(&self, wanted: &Self) -> bool {
        self.grown(wanted, false) == *self
    }
}

/// A buffer that the host reaches and, unless the device is a software driver with but one memory, one for the shaders that is copied to or from it.
#[derive(Debug)]
pub(crate) struct Exchanged {
    host: Buffer,
    device: Option<Buffer>,
}

impl Exchanged {
    fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        bytes: u64,
        place: MemoryUsage,
    ) -> Result<Self, VulkanError> {
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        Ok(Self {
            host: Buffer::new(gpu, what, bytes, storage, place)?,
            device: (!gpu.features().shares_memory)
                .then(|| Buffer::storage(gpu, what, bytes))
                .transpose()?,
        })
    }

    /// What shaders bind.
    pub(crate) fn buffer(&self) -> &Buffer {
        self.device.as_ref().unwrap_or(&self.host)
    }

    /// Writes values on the host's side. The device is not reading them.
    pub(crate) fn write<T: Pod>(&mut self, values: &[T]) {
        self.host.write(values);
    }

    /// Records the copy of the first numbers, more than none, to the device.
    pub(crate) fn record_up(&self, commands: vk::CommandBuffer, numbers: usize) {
        if let Some(device) = &self.device {
            self.host
                .record_copy(commands, device, numbers as u64 * WORD);
        }
    }

    /// Records the copy of the first numbers, more than none, to the host.
    pub(crate) fn record_down(&self, commands: vk::CommandBuffer, numbers: usize) {
        if let Some(device) = &self.device {
            device.record_copy(commands, &self.host, numbers as u64 * WORD);
        }
    }

    /// The first numbers, as they came down. The device has finished writing.
    pub(crate) fn numbers(&mut self, count: usize) -> &[f32] {
        // SAFETY: the buffer is borrowed for as long as the slice lives, and its memory is reached through it alone.
        unsafe { self.host.mapped_slice(count) }
    }
}

/// All buffers, none of which is larger than a device lets a shader address.
#[derive(Debug)]
pub(crate) struct Buffers {
    pub(crate) room: Room,
    /// Rows of `table`.
    pub(crate) lanes: u32,
    pub(crate) attributes: Exchanged,
    pub(crate) splats: Buffer,
    /// By Gaussian and one more: tiles of its rectangle, then where its places begin.
    pub(crate) offsets: Buffer,
    pub(crate) depths: Buffer,
    pub(crate) items: Buffer,
    pub(crate) state: Buffer,
    pub(crate) bins: Buffer,
    pub(crate) placed: [Buffer; 2],
    pub(crate) crowded: Buffer,
    /// What the sort notes of crowded bins, and their parts.
    pub(crate) spans: Buffer,
    pub(crate) parts: Buffer,
    pub(crate) order: Buffer,
    pub(crate) block_sums: Buffer,
    pub(crate) table: Buffer,
    pub(crate) tile_starts: Buffer,
    pub(crate) pairs: Buffer,
    pub(crate) places: Buffer,
    pub(crate) moments: Buffer,
    pub(crate) picture: Exchanged,
    pub(crate) through: Buffer,
    pub(crate) by_pixel: Exchanged,
    pub(crate) derivatives: Exchanged,
    pub(crate) motions: Exchanged,
    /// How many places the last picture wanted.
    pub(crate) total: Buffer,
}

impl Buffers {
    pub(crate) fn new(gpu: &Arc<Gpu>, room: Room) -> Result<Self, VulkanError> {
        let Room {
            gaussians,
            pixels,
            tiles,
            pairs,
        } = room;
        let storage = |what, numbers: u64| Buffer::storage(gpu, what, numbers.saturating_mul(WORD));
        let exchanged = |what, numbers: u64, place| {
            Exchanged::new(gpu, what, numbers.saturating_mul(WORD), place)
        };
        let lanes = lanes(gpu, tiles);
        let (up, down) = (MemoryUsage::Upload, MemoryUsage::ReadBack);
        let planes = ATTRIBUTES as u64 * gaussians;
        let channels = CHANNELS as u64 * pixels;
        let scanned = (gaussians + 1).max(tiles + 1).max(u64::from(BINS));
        let indirect = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER;
        let state_bytes = size_of::<SortState>() as u64;
        Ok(Self {
            room,
            lanes,
            attributes: exchanged("Gaussians", planes, up)?,
            splats: storage("splats", SPLAT * gaussians)?,
            offsets: storage("Gaussians' places", gaussians + 1)?,
            depths: storage("depths", gaussians)?,
            items: storage("drawn Gaussians", gaussians)?,
            state: Buffer::new(
                gpu,
                "sort state",
                state_bytes,
                indirect,
                MemoryUsage::Device,
            )?,
            bins: storage("sort bins", u64::from(BINS))?,
            placed: [
                storage("placed values", gaussians)?,
                storage("placed items", gaussians)?,
            ],
            crowded: storage("crowded bins", gaussians / u64::from(CROWDED + 1))?,
            spans: storage(
                "spans of crowded bins",
                (gaussians / u64::from(CROWDED + 1) + 1) * (SPAN_BYTES / 4),
            )?,
            parts: storage(
                "parts of crowded bins",
                gaussians / u64::from(ITEMS_PER_PART) + 1,
            )?,
            order: storage("sorted order", gaussians)?,
            block_sums: storage("prefix sums", scanned.div_ceil(u64::from(SCAN_BLOCK)))?,
            table: storage("tile counts", tiles * u64::from(lanes))?,
            tile_starts: storage("tile lists", tiles + 1)?,
            pairs: storage("pairs of tile and splat", pairs)?,
            places: storage("pairs by Gaussian", pairs)?,
            moments: storage("splats' moments", pairs.saturating_mul(MOMENTS))?,
            picture: exchanged("the picture", channels, down)?,
            through: storage("transmittance", pixels)?,
            by_pixel: exchanged("derivatives by pixels", channels, up)?,
            derivatives: exchanged("derivatives by Gaussians", planes, down)?,
            motions: exchanged(
                "derivatives by the camera",
                TWIST * gaussians.div_ceil(GROUP as u64),
                down,
            )?,
            total: Buffer::new(
                gpu,
                "pair count",
                WORD,
                vk::BufferUsageFlags::empty(),
                MemoryUsage::ReadBack,
            )?,
        })
    }
}

/// Invocations that share the sorted splats among them when lists are made: a software driver has a few cores to feed, a GPU thousands of lanes.
fn lanes(gpu: &Gpu, tiles: u64) -> u32 {
    let limit = TABLE_BYTES.min(u64::from(gpu.limits().max_storage_buffer_range));
    let mut lanes = if gpu.info().is_cpu { 128 } else { 1024 };
    while lanes > 32 && tiles * WORD * u64::from(lanes) > limit {
        lanes /= 2;
    }
    lanes
}
