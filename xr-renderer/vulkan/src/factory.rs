//! Makes Vulkan's instance and device: by this program, or by the OpenXR runtime of a headset, which adds what it needs itself.

use ash::vk;

use crate::error::{VkContext, VulkanError};

/// Makes the instance and the device that a [`Gpu`](crate::gpu::Gpu) is opened with.
///
/// This program uses and destroys what it returns as if it had made it with the same loader.
pub trait VulkanFactory {
    /// Why it may fail.
    type Error: From<VulkanError>;

    /// The newest version of Vulkan that it supports, packed as in `VkApplicationInfo`.
    fn newest_version(&self) -> u32;

    /// Whether it chains feature structures of its own to the device's description. Then do not chain
    /// `VkPhysicalDeviceVulkan1xFeatures`: Vulkan forbids these structures beside those of the single features they contain, and which
    /// ones a runtime adds is not known.
    fn adds_features(&self) -> bool;

    /// Makes an instance with this loader.
    ///
    /// # Errors
    /// No driver, or a call that fails.
    fn instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance, Self::Error>;

    /// The only device that it accepts; none if every device will do.
    ///
    /// # Errors
    /// A call that fails.
    fn wanted_device(
        &self,
        instance: &ash::Instance,
    ) -> Result<Option<vk::PhysicalDevice>, Self::Error>;

    /// Makes a device of that instance.
    ///
    /// # Errors
    /// A call that fails.
    fn device(
        &self,
        entry: &ash::Entry,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device, Self::Error>;
}

/// Plain Vulkan calls.
pub(crate) struct OwnFactory;

impl VulkanFactory for OwnFactory {
    type Error = VulkanError;

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
    ) -> Result<ash::Instance, VulkanError> {
        // SAFETY: names and structures live until the call returns.
        unsafe { entry.create_instance(info, None) }.map_err(instance_error)
    }

    fn wanted_device(&self, _: &ash::Instance) -> Result<Option<vk::PhysicalDevice>, VulkanError> {
        Ok(None)
    }

    fn device(
        &self,
        _: &ash::Entry,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device, VulkanError> {
        // SAFETY: the physical device is the instance's; all structures live until the call returns.
        unsafe { instance.create_device(physical, info, None) }.during("vkCreateDevice")
    }
}

/// The error that a failure of `vkCreateInstance` means.
#[must_use]
pub fn instance_error(result: vk::Result) -> VulkanError {
    match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => VulkanError::NoDevice,
        result => VulkanError::Call {
            call: "vkCreateInstance",
            result,
        },
    }
}
