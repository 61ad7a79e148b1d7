//! A Vulkan buffer with memory of its own.

use std::ptr::NonNull;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;
use crate::memory::Memory;

/// Who touches a buffer's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// The device alone.
    Device,
    /// The host writes, the device reads.
    Upload,
    /// The device writes, the host reads.
    ReadBack,
}

impl Place {
    /// Kinds of memory, the best first.
    fn memory(self) -> &'static [vk::MemoryPropertyFlags] {
        use vk::MemoryPropertyFlags as Flags;
        const ANY: Flags = Flags::empty();
        const SHARED: Flags =
            Flags::from_raw(Flags::HOST_VISIBLE.as_raw() | Flags::HOST_COHERENT.as_raw());
        const CACHED: Flags = Flags::from_raw(SHARED.as_raw() | Flags::HOST_CACHED.as_raw());
        match self {
            Self::Device => &[Flags::DEVICE_LOCAL, ANY],
            Self::Upload => &[SHARED],
            Self::ReadBack => &[CACHED, SHARED],
        }
    }
}

/// A buffer, its memory, and where the host sees it.
pub(crate) struct Buffer {
    gpu: Arc<Gpu>,
    handle: vk::Buffer,
    memory: Option<Memory>,
    size: u64,
    mapped: Option<NonNull<u8>>,
}

// SAFETY: the mapped pointer is to memory that the buffer owns, and is reached through &self or &mut self.
unsafe impl Send for Buffer {}
// SAFETY: &self only reads.
unsafe impl Sync for Buffer {}

impl Buffer {
    /// A storage (or, with `usage`, other) buffer of at least `size` bytes that can also be copied and filled.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        size: u64,
        usage: vk::BufferUsageFlags,
        place: Place,
    ) -> Result<Self, RenderError> {
        let size = size.max(16).next_multiple_of(4);
        let limit = u64::from(gpu.limits.max_storage_buffer_range);
        if usage.contains(vk::BufferUsageFlags::STORAGE_BUFFER) && size > limit {
            return Err(RenderError::TooLarge {
                what,
                bytes: size,
                limit,
            });
        }
        let usage = usage | vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the structure is complete.
        let handle = unsafe { gpu.device().create_buffer(&info, None) }.during("vkCreateBuffer")?;
        // Owns the handle from here on, so that an error below frees it.
        let mut buffer = Self {
            gpu: Arc::clone(gpu),
            handle,
            memory: None,
            size,
            mapped: None,
        };
        // SAFETY: the handle is a buffer of this device.
        let needs = unsafe { gpu.device().get_buffer_memory_requirements(handle) };
        let memory = Memory::new(gpu, what, needs, place.memory())?;
        let memory_handle = memory.handle();
        buffer.memory = Some(memory);
        // SAFETY: fresh memory of the size and type the buffer asked for.
        unsafe { gpu.device().bind_buffer_memory(handle, memory_handle, 0) }
            .during("vkBindBufferMemory")?;
        if place != Place::Device {
            // SAFETY: the memory is host visible and not mapped yet.
            let address = unsafe {
                gpu.device().map_memory(
                    memory_handle,
                    0,
                    vk::WHOLE_SIZE,
                    vk::MemoryMapFlags::empty(),
                )
            }
            .during("vkMapMemory")?;
            buffer.mapped = NonNull::new(address.cast());
        }
        Ok(buffer)
    }

    /// A storage buffer on the device.
    pub(crate) fn storage(
        gpu: &Arc<Gpu>,
        what: &'static str,
        size: u64,
    ) -> Result<Self, RenderError> {
        Self::new(
            gpu,
            what,
            size,
            vk::BufferUsageFlags::STORAGE_BUFFER,
            Place::Device,
        )
    }

    pub(crate) fn handle(&self) -> vk::Buffer {
        self.handle
    }

    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Copies values to the buffer's start. The caller made the buffer for uploads, large enough, and the
    /// device is not reading it.
    pub(crate) fn write<T: Pod>(&mut self, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let Some(target) = self.mapped else {
            unreachable!("made for uploads")
        };
        assert!(
            bytes.len() as u64 <= self.size,
            "{} bytes into {}",
            bytes.len(),
            self.size
        );
        // SAFETY: the mapping is `size` bytes long, ours, and disjoint from `values`.
        unsafe {
            target
                .as_ptr()
                .copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        }
    }

    /// The buffer's first `count` values. The caller made the buffer for reading back, large enough, and
    /// the device has finished writing.
    pub(crate) fn read<T: Pod>(&self, count: usize) -> Vec<T> {
        let Some(source) = self.mapped else {
            unreachable!("made for reading back")
        };
        let bytes = count * size_of::<T>();
        assert!(
            bytes as u64 <= self.size,
            "{bytes} bytes out of {}",
            self.size
        );
        let mut values = vec![T::zeroed(); count];
        // SAFETY: the mapping is `size` bytes long and holds initialised, coherent memory; T is plain data.
        unsafe {
            source
                .as_ptr()
                .copy_to_nonoverlapping(values.as_mut_ptr().cast::<u8>(), bytes);
        }
        values
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop; the memory is freed, and so unmapped, after this.
        unsafe { self.gpu.device().destroy_buffer(self.handle, None) };
    }
}
