//! Who makes Vulkan's instance and device: this program itself, or the runtime of a headset, which adds what it needs.

use ash::vk;

use crate::error::{RenderError, VkContext};
use crate::instance::Instance;

/// Makes instance and device as they are described.
pub(crate) trait Maker {
    /// The newest version of Vulkan it can do with.
    fn newest_version(&self) -> u32;

    /// Whether it asks the device for features of its own, one by one: a description must not then have those of a whole
    /// version of Vulkan in it.
    fn adds_features(&self) -> bool;

    /// An instance of this loader.
    fn instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance, RenderError>;

    /// The only device it would take, if it is not all the same to it.
    fn wanted_device(&self, instance: &Instance)
    -> Result<Option<vk::PhysicalDevice>, RenderError>;

    /// A device of that instance.
    fn device(
        &self,
        instance: &Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device, RenderError>;
}

/// This program itself.
pub(crate) struct Own;

impl Maker for Own {
    fn newest_version(&self) -> u32 {
        u32::MAX
    }

    fn adds_features(&self) -> bool {
        false
    }

    fn instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance, RenderError> {
        // SAFETY: names and structures live until the call returns.
        unsafe { entry.create_instance(info, None) }.map_err(instance_error)
    }

    fn wanted_device(&self, _: &Instance) -> Result<Option<vk::PhysicalDevice>, RenderError> {
        Ok(None)
    }

    fn device(
        &self,
        instance: &Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device, RenderError> {
        // SAFETY: the physical device is the instance's; all structures live until the call returns.
        unsafe { instance.handle.create_device(physical, info, None) }.during("vkCreateDevice")
    }
}

/// What it means that no instance was made.
pub(crate) fn instance_error(result: vk::Result) -> RenderError {
    match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => RenderError::NoDevice,
        result => RenderError::Vulkan {
            call: "vkCreateInstance",
            result,
        },
    }
}
