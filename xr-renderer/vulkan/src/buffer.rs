//! A Vulkan buffer with memory of its own.

use std::ptr::NonNull;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;
use crate::memory::Memory;

/// Which side writes a buffer and which reads it; decides the kind of memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MemoryUsage {
    /// The device alone.
    Device,
    /// The host writes, the device reads.
    Upload,
    /// The device writes, the host reads.
    ReadBack,
}

impl MemoryUsage {
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
#[derive(Debug)]
pub struct Buffer {
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
    ///
    /// # Errors
    /// A storage buffer that is larger than the device lets a shader address, too little memory, or a device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        size: u64,
        usage: vk::BufferUsageFlags,
        place: MemoryUsage,
    ) -> Result<Self, VulkanError> {
        let size = size.max(16).next_multiple_of(4);
        let limit = u64::from(gpu.limits.max_storage_buffer_range);
        if usage.contains(vk::BufferUsageFlags::STORAGE_BUFFER) && size > limit {
            return Err(VulkanError::TooLarge {
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
        if place != MemoryUsage::Device {
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
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn storage(gpu: &Arc<Gpu>, what: &'static str, size: u64) -> Result<Self, VulkanError> {
        Self::new(
            gpu,
            what,
            size,
            vk::BufferUsageFlags::STORAGE_BUFFER,
            MemoryUsage::Device,
        )
    }

    /// For commands and descriptor sets.
    pub fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Its size in bytes, which may be a little more than was asked for.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Copies values to the buffer's start. The device is not reading it.
    ///
    /// # Panics
    /// If the buffer was not made for [`MemoryUsage::Upload`], or is smaller than the values.
    pub fn write<T: Pod>(&mut self, values: &[T]) {
        self.write_at(0, values);
    }

    /// As [`Self::write`], from the place of the value number `first` on.
    ///
    /// # Panics
    /// As [`Self::write`].
    pub fn write_at<T: Pod>(&mut self, first: usize, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let start = first * size_of::<T>();
        let Some(target) = self.mapped else {
            unreachable!("made for uploads")
        };
        assert!(
            (start + bytes.len()) as u64 <= self.size,
            "{} bytes at {start} into {}",
            bytes.len(),
            self.size
        );
        // SAFETY: the mapping is `size` bytes long, ours, and disjoint from `values`.
        unsafe {
            target
                .as_ptr()
                .add(start)
                .copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        }
    }

    /// The buffer's first `count` values in place, for the host to write.
    ///
    /// # Panics
    /// As [`Self::write`].
    ///
    /// # Safety
    /// Nothing else accesses the buffer's memory from the host while the slice lives.
    #[expect(
        clippy::mut_from_ref,
        reason = "the buffer is shared for its handle; the caller owns its memory"
    )]
    pub unsafe fn mapped_slice<T: Pod>(&self, count: usize) -> &mut [T] {
        let Some(start) = self.mapped else {
            unreachable!("made for uploads")
        };
        let bytes = (count * size_of::<T>()) as u64;
        assert!(bytes <= self.size, "{bytes} bytes in {}", self.size);
        // SAFETY: the mapping is `size` bytes long, aligned to a page, and ours alone (the caller's promise); any bits
        // are a T.
        unsafe { std::slice::from_raw_parts_mut(start.as_ptr().cast(), count) }
    }

    /// Records the copy of the first bytes, more than none, to another buffer; both hold as many.
    pub fn record_copy(&self, commands: vk::CommandBuffer, to: &Self, bytes: u64) {
        self.record_copy_to(commands, to, 0, bytes);
    }

    /// The same, to a place in the other buffer, which holds as many from there on.
    pub fn record_copy_to(&self, commands: vk::CommandBuffer, to: &Self, start: u64, bytes: u64) {
        let region = [vk::BufferCopy::default().dst_offset(start).size(bytes)];
        // SAFETY: the command buffer is being recorded; both buffers hold as many bytes.
        unsafe {
            let device = self.gpu.device();
            device.cmd_copy_buffer(commands, self.handle, to.handle, &region);
        }
    }

    /// Whether it was made on this device.
    pub fn is_on(&self, gpu: &Arc<Gpu>) -> bool {
        Arc::ptr_eq(&self.gpu, gpu)
    }

    /// The buffer's first value. The device has finished writing.
    ///
    /// # Panics
    /// As [`Self::read`].
    pub fn read_one<T: Pod>(&self) -> T {
        let mut value = T::zeroed();
        self.read_into(std::slice::from_mut(&mut value));
        value
    }

    /// The buffer's first `count` values. The device has finished writing.
    ///
    /// # Panics
    /// If the buffer was not made for [`MemoryUsage::ReadBack`], or is smaller than the values.
    pub fn read<T: Pod>(&self, count: usize) -> Vec<T> {
        let mut values = vec![T::zeroed(); count];
        self.read_into(&mut values);
        values
    }

    fn read_into<T: Pod>(&self, values: &mut [T]) {
        let Some(source) = self.mapped else {
            unreachable!("made for reading back")
        };
        let bytes = size_of_val(values);
        assert!(
            bytes as u64 <= self.size,
            "{bytes} bytes out of {}",
            self.size
        );
        // SAFETY: the mapping is `size` bytes long and holds initialised, coherent memory; T is plain data.
        unsafe {
            source
                .as_ptr()
                .copy_to_nonoverlapping(values.as_mut_ptr().cast::<u8>(), bytes);
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop; the memory is freed, and so unmapped, after this.
        unsafe { self.gpu.device().destroy_buffer(self.handle, None) };
    }
}
