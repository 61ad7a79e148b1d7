//! Device memory. Allocations are counted, so that an error can say how much is taken.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;

use crate::error::VulkanError;
use crate::gpu::Gpu;

/// One allocation; freed on drop.
#[derive(Debug)]
pub(crate) struct Memory {
    gpu: Arc<Gpu>,
    handle: vk::DeviceMemory,
    size: u64,
}

impl Memory {
    /// Memory of the first of `kinds` that the device has and `needs` allows.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        needs: vk::MemoryRequirements,
        kinds: &[vk::MemoryPropertyFlags],
    ) -> Result<Self, VulkanError> {
        let types = gpu.memory.memory_types_as_slice();
        let found = kinds.iter().find_map(|kind| {
            (0u32..).zip(types).find(|(index, offered)| {
                needs.memory_type_bits & (1 << index) != 0 && offered.property_flags.contains(*kind)
            })
        });
        let heaps = gpu.memory.memory_heaps_as_slice();
        let heap = found.and_then(|(_, kind)| heaps.get(kind.heap_index as usize));
        let no_memory = || VulkanError::OutOfMemory {
            what,
            bytes: needs.size,
            taken: gpu.memory_taken.load(Ordering::Relaxed),
            heap: heap.map_or(0, |heap| heap.size),
        };
        let (index, _) = found.ok_or_else(no_memory)?;
        // Some drivers allocate more than there is, and fail when it is used.
        if heap.is_some_and(|heap| needs.size > heap.size) {
            return Err(no_memory());
        }
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(index);
        // SAFETY: the type index is one of the device's.
        let handle =
            unsafe { gpu.device().allocate_memory(&info, None) }.map_err(
                |result| match result {
                    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
                    | vk::Result::ERROR_OUT_OF_HOST_MEMORY
                    | vk::Result::ERROR_TOO_MANY_OBJECTS => no_memory(),
                    result => VulkanError::Call {
                        call: "vkAllocateMemory",
                        result,
                    },
                },
            )?;
        gpu.memory_taken.fetch_add(needs.size, Ordering::Relaxed);
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle,
            size: needs.size,
        })
    }

    pub(crate) fn handle(&self) -> vk::DeviceMemory {
        self.handle
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device, and destroy what is bound to the memory, before they drop it.
        unsafe { self.gpu.device().free_memory(self.handle, None) };
        self.gpu
            .memory_taken
            .fetch_sub(self.size, Ordering::Relaxed);
    }
}
