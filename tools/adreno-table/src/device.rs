//! The pretended Adreno: the first device of Mesa's turnip, opened so that it reports its compiler's statistics.

use anyhow::{Context, ensure};
use ash::{khr, vk};

/// The opened device. It lives as long as the program and is not destroyed.
pub(crate) struct Device {
    pub(crate) handle: ash::Device,
    pub(crate) executables: khr::pipeline_executable_properties::Device,
    /// The device's name and chip number.
    pub(crate) name: String,
    /// The driver's name and version.
    pub(crate) driver: String,
    _entry: ash::Entry,
    _instance: ash::Instance,
}

impl Device {
    pub(crate) fn open() -> anyhow::Result<Self> {
        // SAFETY: the loader and the one driver that the caller's environment names are Debian's, and are never unloaded.
        let entry = unsafe { ash::Entry::load() }
            .context("no Vulkan loader: start this with android/adreno.sh")?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: the structure is complete.
        let instance = unsafe { entry.create_instance(&info, None) }.context("vkCreateInstance")?;
        // SAFETY: no preconditions.
        let devices = unsafe { instance.enumerate_physical_devices() }
            .context("vkEnumeratePhysicalDevices")?;
        let physical = *devices
            .first()
            .context("no Vulkan device: start this with android/adreno.sh")?;

        let mut about = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut about);
        // SAFETY: the structures are complete; the driver knows Vulkan 1.2 (asked below, and it is pinned).
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let properties = properties.properties;
        ensure!(
            about.driver_id == vk::DriverId::MESA_TURNIP,
            "the Vulkan device is not turnip's: start this with android/adreno.sh"
        );
        let text = |bytes: Result<&std::ffi::CStr, _>| {
            bytes
                .map(|text| text.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
        let name = format!(
            "{} (chip {:#010x})",
            text(properties.device_name_as_c_str()),
            properties.device_id
        );
        let driver = format!(
            "{} {}",
            text(about.driver_name_as_c_str()),
            text(about.driver_info_as_c_str())
        );

        let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
        let mut vulkan_13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut vulkan_12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut vulkan_11 = vk::PhysicalDeviceVulkan11Features::default();
        // Whatever it has, as it costs a shader nothing, but for robust buffer access: the renderer does without.
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut statistics)
            .push_next(&mut vulkan_13)
            .push_next(&mut vulkan_12)
            .push_next(&mut vulkan_11);
        // SAFETY: the structures are complete.
        unsafe { instance.get_physical_device_features2(physical, &mut features) };
        features.features.robust_buffer_access = vk::FALSE;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&priorities)];
        let extensions = [khr::pipeline_executable_properties::NAME.as_ptr()];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut features);
        // SAFETY: names and structures live until the call returns; the features are the device's own.
        let handle =
            unsafe { instance.create_device(physical, &info, None) }.context("vkCreateDevice")?;
        Ok(Self {
            executables: khr::pipeline_executable_properties::Device::new(&instance, &handle),
            handle,
            name,
            driver,
            _entry: entry,
            _instance: instance,
        })
    }
}
