//! Real Vulkan where a test wants it (`World::vulkan`): instance and device as `XR_KHR_vulkan_enable2` makes them, and
//! swapchains of real images, so that what is drawn for a headset can be drawn on any machine's Vulkan.

#![allow(
    clippy::undocumented_unsafe_blocks,
    reason = "each rests on the same: a session's device outlives it, and its images are not used once they are destroyed"
)]

use ash::vk::{self, Handle as _};
use openxr::SwapchainUsageFlags as Usage;
use openxr::sys;
use openxr::sys::platform::VkGetInstanceProcAddr;

use super::pointers::read;

/// Vulkan's functions, as the caller of `xrCreateVulkanInstanceKHR` gave them.
#[derive(Clone)]
pub(super) struct Loader(ash::StaticFn);

impl Loader {
    pub(super) fn new(function: Option<VkGetInstanceProcAddr>) -> Self {
        let function = function.expect("the caller names a loader");
        // The same C function, whose handle is a pointer in one description and a transparent struct of one in the other.
        let get_instance_proc_addr = unsafe {
            std::mem::transmute::<VkGetInstanceProcAddr, vk::PFN_vkGetInstanceProcAddr>(function)
        };
        Self(ash::StaticFn {
            get_instance_proc_addr,
        })
    }

    fn instance(&self, handle: vk::Instance) -> ash::Instance {
        unsafe { ash::Instance::load(&self.0, handle) }
    }

    /// `vkCreateInstance`.
    pub(super) fn create_instance(
        &self,
        info: *const vk::InstanceCreateInfo<'static>,
    ) -> (vk::Result, vk::Instance) {
        let entry = unsafe { ash::Entry::from_static_fn(self.0.clone()) };
        let mut made = vk::Instance::null();
        let create = entry.fp_v1_0().create_instance;
        let result = unsafe { create(info, std::ptr::null(), &mut made) };
        (result, made)
    }

    /// The first device there is.
    pub(super) fn physical_device(&self, instance: vk::Instance) -> vk::PhysicalDevice {
        let devices = unsafe { self.instance(instance).enumerate_physical_devices() };
        devices.expect("a list of devices")[0]
    }

    /// `vkCreateDevice`, of the instance that was made last.
    pub(super) fn create_device(
        &self,
        instance: vk::Instance,
        physical: vk::PhysicalDevice,
        info: *const vk::DeviceCreateInfo<'static>,
    ) -> (vk::Result, vk::Device) {
        let mut made = vk::Device::null();
        let create = self.instance(instance).fp_v1_0().create_device;
        let result = unsafe { create(physical, info, std::ptr::null(), &mut made) };
        (result, made)
    }

    /// What a session's binding names.
    pub(super) fn device(&self, binding: &sys::GraphicsBindingVulkanKHR) -> SessionDevice {
        let instance = self.instance(vk::Instance::from_raw(binding.instance as u64));
        let device = vk::Device::from_raw(binding.device as u64);
        SessionDevice {
            device: unsafe { ash::Device::load(instance.fp_v1_0(), device) },
            queue_family: binding.queue_family_index,
        }
    }
}

/// The device that a session is drawn with.
#[derive(Clone)]
pub(super) struct SessionDevice {
    device: ash::Device,
    queue_family: u32,
}

/// A swapchain's images with their memory.
pub(super) struct Images {
    device: ash::Device,
    images: Vec<(vk::Image, vk::DeviceMemory)>,
}

impl SessionDevice {
    pub(super) fn images(&self, info: &sys::SwapchainCreateInfo, count: u32) -> Images {
        // Tests look at them, and they are given back in an attachment's layout whatever they are used for.
        let mut usage = vk::ImageUsageFlags::TRANSFER_SRC
            | match vk::Format::from_raw(info.format as i32) {
                vk::Format::D32_SFLOAT => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
                _ => vk::ImageUsageFlags::COLOR_ATTACHMENT,
            };
        for (wanted, means) in [
            (
                Usage::COLOR_ATTACHMENT,
                vk::ImageUsageFlags::COLOR_ATTACHMENT,
            ),
            (
                Usage::DEPTH_STENCIL_ATTACHMENT,
                vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            ),
            (Usage::UNORDERED_ACCESS, vk::ImageUsageFlags::STORAGE),
            (Usage::TRANSFER_SRC, vk::ImageUsageFlags::TRANSFER_SRC),
            (Usage::TRANSFER_DST, vk::ImageUsageFlags::TRANSFER_DST),
            (Usage::SAMPLED, vk::ImageUsageFlags::SAMPLED),
        ] {
            if info.usage_flags.contains(wanted) {
                usage |= means;
            }
        }
        let flags = if info.usage_flags.contains(Usage::MUTABLE_FORMAT) {
            vk::ImageCreateFlags::MUTABLE_FORMAT
        } else {
            vk::ImageCreateFlags::empty()
        };
        let info = vk::ImageCreateInfo::default()
            .flags(flags)
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::from_raw(info.format as i32))
            .extent(vk::Extent3D {
                width: info.width,
                height: info.height,
                depth: 1,
            })
            .mip_levels(info.mip_count)
            .array_layers(info.array_size)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        self.several(&info, count)
    }

    fn several(&self, info: &vk::ImageCreateInfo<'_>, count: u32) -> Images {
        Images {
            device: self.device.clone(),
            images: (0..count).map(|_| self.image(info)).collect(),
        }
    }

    /// Density maps that have all of a swapchain's images drawn finely, on a device that knows such maps.
    pub(super) fn maps(&self, [width, height]: [u32; 2], layers: u32, count: u32) -> Images {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R8G8_UNORM)
            .extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })
            .mip_levels(1)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(
                vk::ImageUsageFlags::FRAGMENT_DENSITY_MAP_EXT | vk::ImageUsageFlags::TRANSFER_DST,
            );
        let maps = self.several(&info, count);
        self.run(|commands| {
            for (map, _) in &maps.images {
                self.record_fine(commands, *map, layers);
            }
        });
        maps
    }

    fn record_fine(&self, commands: vk::CommandBuffer, map: vk::Image, layers: u32) {
        let range = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            level_count: 1,
            layer_count: layers,
            ..Default::default()
        };
        let change = |from, to| {
            [vk::ImageMemoryBarrier::default()
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(map)
                .subresource_range(range)
                .old_layout(from)
                .new_layout(to)
                .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
                .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)]
        };
        let writable = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let fine = vk::ClearColorValue { float32: [1.0; 4] };
        let last = vk::ImageLayout::FRAGMENT_DENSITY_MAP_OPTIMAL_EXT;
        let all = vk::PipelineStageFlags::ALL_COMMANDS;
        let none = vk::DependencyFlags::empty();
        unsafe {
            let before = change(vk::ImageLayout::UNDEFINED, writable);
            (self.device).cmd_pipeline_barrier(commands, all, all, none, &[], &[], &before);
            (self.device).cmd_clear_color_image(commands, map, writable, &fine, &[range]);
            let after = change(writable, last);
            (self.device).cmd_pipeline_barrier(commands, all, all, none, &[], &[], &after);
        }
    }

    fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        let device = &self.device;
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(self.queue_family);
        unsafe {
            let pool = device.create_command_pool(&pool, None).expect("a pool");
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info).expect("commands");
            let begin = vk::CommandBufferBeginInfo::default();
            device
                .begin_command_buffer(commands[0], &begin)
                .expect("begun");
            record(commands[0]);
            device.end_command_buffer(commands[0]).expect("recorded");
            let queue = device.get_device_queue(self.queue_family, 0);
            let submit = [vk::SubmitInfo::default().command_buffers(&commands)];
            let fence = vk::Fence::null();
            device
                .queue_submit(queue, &submit, fence)
                .expect("submitted");
            device.queue_wait_idle(queue).expect("done");
            device.destroy_command_pool(pool, None);
        }
    }

    fn image(&self, info: &vk::ImageCreateInfo<'_>) -> (vk::Image, vk::DeviceMemory) {
        let device = &self.device;
        unsafe {
            let image = device.create_image(info, None).expect("an image");
            let needs = device.get_image_memory_requirements(image);
            let memory = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(needs.memory_type_bits.trailing_zeros());
            let memory = device.allocate_memory(&memory, None).expect("memory");
            device
                .bind_image_memory(image, memory, 0)
                .expect("memory bound");
            (image, memory)
        }
    }
}

impl Images {
    pub(super) fn handle(&self, place: usize) -> u64 {
        self.images[place].0.as_raw()
    }
}

impl Drop for Images {
    fn drop(&mut self) {
        for (image, memory) in &self.images {
            unsafe {
                self.device.destroy_image(*image, None);
                self.device.free_memory(*memory, None);
            }
        }
    }
}

/// The binding of a session's making, if there is one.
pub(super) fn binding(next: *const std::ffi::c_void) -> Option<sys::GraphicsBindingVulkanKHR> {
    super::pointers::chained(next)
        .into_iter()
        .find(|(ty, _)| *ty == sys::GraphicsBindingVulkanKHR::TYPE)
        .map(|(_, at)| read(at.cast::<sys::GraphicsBindingVulkanKHR>()))
}
