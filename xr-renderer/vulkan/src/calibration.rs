//! Reading the device's clock on request (`VK_KHR_calibrated_timestamps`).

use std::ffi::CStr;

use ash::{ext, khr, vk};

use crate::error::{VkContext, VulkanError};
use crate::instance::{Instance, contains};

/// Reads the device's clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Calibration(vk::PFN_vkGetCalibratedTimestampsKHR);

impl Calibration {
    /// The extension that the device offers, to be enabled, if it reads its own clock.
    pub(crate) fn extension(
        instance: &Instance,
        device: vk::PhysicalDevice,
        offered: &[vk::ExtensionProperties],
    ) -> Option<&'static CStr> {
        let (entry, handle) = (&instance.entry, &instance.handle);
        // SAFETY: each function is called where its extension is offered, for a device of this instance.
        let (name, domains) = unsafe {
            if contains(offered, khr::calibrated_timestamps::NAME) {
                let loader = khr::calibrated_timestamps::Instance::new(entry, handle);
                let domains = loader.get_physical_device_calibrateable_time_domains(device);
                (khr::calibrated_timestamps::NAME, domains)
            } else if contains(offered, ext::calibrated_timestamps::NAME) {
                let loader = ext::calibrated_timestamps::Instance::new(entry, handle);
                let domains = loader.get_physical_device_calibrateable_time_domains(device);
                (ext::calibrated_timestamps::NAME, domains)
            } else {
                return None;
            }
        };
        let reads_its_own =
            domains.is_ok_and(|domains| domains.contains(&vk::TimeDomainKHR::DEVICE));
        reads_its_own.then_some(name)
    }

    /// The function, of the extension that was enabled.
    pub(crate) fn new(instance: &Instance, device: &ash::Device, extension: &CStr) -> Self {
        Self(if extension == khr::calibrated_timestamps::NAME {
            let loader = khr::calibrated_timestamps::Device::new(&instance.handle, device);
            loader.fp().get_calibrated_timestamps_khr
        } else {
            let loader = ext::calibrated_timestamps::Device::new(&instance.handle, device);
            loader.fp().get_calibrated_timestamps_ext
        })
    }

    /// The device's time now, in ticks.
    pub(crate) fn device_ticks(self, device: &ash::Device) -> Result<u64, VulkanError> {
        let asked =
            vk::CalibratedTimestampInfoKHR::default().time_domain(vk::TimeDomainKHR::DEVICE);
        let (mut tick, mut deviation) = (0, 0);
        // SAFETY: the extension is enabled; one question, room for one answer.
        unsafe {
            (self.0)(
                device.handle(),
                1,
                &raw const asked,
                &raw mut tick,
                &raw mut deviation,
            )
        }
        .result()
        .during("vkGetCalibratedTimestamps")?;
        Ok(tick)
    }
}
