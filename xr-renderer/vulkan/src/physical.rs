//! The properties of a physical device, and whether it can run the shaders.

use ash::{ext, khr, vk};
use vk::PhysicalDeviceFeatures2 as Features2;

use crate::error::{VkContext, VulkanError};
use crate::instance::contains;

/// Storage buffers that `shaders/project_background.comp` binds, more than any other.
const STORAGE_BUFFERS: u32 = 9;

/// Facts about a device, for people and for reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceInfo {
    /// The device's name, as its driver gives it.
    pub name: String,
    /// The driver's name and version, as far as it tells.
    pub driver: String,
    /// Vulkan version of the device, `1.3.255` say.
    pub api_version: String,
    /// Whether the "GPU" is a software driver on the CPU.
    pub is_cpu: bool,
}

/// How many invocations a subgroup has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Subgroup {
    pub(crate) size: u32,
    /// Pipelines can ask for that size, and for full subgroups.
    pub(crate) can_be_required: bool,
}

/// A device that may be able to draw, with all that is needed to open it.
pub(crate) struct Candidate {
    pub(crate) handle: vk::PhysicalDevice,
    pub(crate) info: DeviceInfo,
    pub(crate) kind: vk::PhysicalDeviceType,
    pub(crate) driver_id: vk::DriverId,
    pub(crate) api_version: u32,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    pub(crate) extensions: Vec<vk::ExtensionProperties>,
}

/// How a device that can draw is used.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Capabilities {
    pub(crate) subgroup: Subgroup,
    pub(crate) queue_family: u32,
    /// Bits of a timestamp that count; 0 where the queue has none.
    pub(crate) timestamp_bits: u32,
    /// Lanes exchange values by broadcasts from any lane, and that is fast.
    pub(crate) broadcasts: bool,
    /// Pictures can be drawn coarser where a map says so (`VK_EXT_fragment_density_map`), into images of any kind.
    pub(crate) density_maps: bool,
}

fn text(bytes: Result<&std::ffi::CStr, std::ffi::FromBytesUntilNulError>) -> String {
    bytes
        .map(|text| text.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn version(packed: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(packed),
        vk::api_version_minor(packed),
        vk::api_version_patch(packed)
    )
}

impl Candidate {
    /// Reads a device's properties. It may still turn out unable to draw: see [`Self::capabilities`].
    pub(crate) fn read(
        instance: &ash::Instance,
        handle: vk::PhysicalDevice,
    ) -> Result<Self, VulkanError> {
        // SAFETY: the handle was enumerated from this instance.
        let extensions = unsafe { instance.enumerate_device_extension_properties(handle) }
            .during("vkEnumerateDeviceExtensionProperties")?;
        // SAFETY: as above.
        let basic = unsafe { instance.get_physical_device_properties(handle) };
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        if basic.api_version >= vk::API_VERSION_1_1
            && (basic.api_version >= vk::API_VERSION_1_2
                || contains(&extensions, khr::driver_properties::NAME))
        {
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            // SAFETY: the chained structure is known to the device (checked above).
            unsafe { instance.get_physical_device_properties2(handle, &mut properties) };
        }
        let driver_name = text(driver.driver_name_as_c_str());
        let driver_info = text(driver.driver_info_as_c_str());
        Ok(Self {
            handle,
            info: DeviceInfo {
                name: text(basic.device_name_as_c_str()),
                driver: if driver_name.is_empty() {
                    format!("unnamed driver {:#x}", basic.driver_version)
                } else {
                    format!("{driver_name} {driver_info}").trim().to_owned()
                },
                api_version: version(basic.api_version),
                is_cpu: basic.device_type == vk::PhysicalDeviceType::CPU,
            },
            kind: basic.device_type,
            driver_id: driver.driver_id,
            api_version: basic.api_version,
            limits: basic.limits,
            extensions,
        })
    }

    fn lacks(&self, what: impl Into<String>) -> VulkanError {
        VulkanError::Unsupported {
            device: self.info.name.clone(),
            lacks: vec![what.into()],
        }
    }

    /// What to open the device with, or what it lacks.
    pub(crate) fn capabilities(
        &self,
        instance: &ash::Instance,
    ) -> Result<Capabilities, VulkanError> {
        let subgroup = self.subgroup(instance)?;
        let (queue_family, family) = self.queue_family(instance)?;
        Ok(Capabilities {
            subgroup,
            queue_family,
            timestamp_bits: family.timestamp_valid_bits,
            broadcasts: self.broadcasts(instance),
            density_maps: self.density_maps(instance),
        })
    }

    /// Whether broadcasts from a non-constant lane are supported and fast: on Adreno shared memory is faster.
    fn broadcasts(&self, instance: &ash::Instance) -> bool {
        let adreno = [
            vk::DriverId::MESA_TURNIP,
            vk::DriverId::QUALCOMM_PROPRIETARY,
        ];
        if self.api_version < vk::API_VERSION_1_2 || adreno.contains(&self.driver_id) {
            return false;
        }
        let mut newer = vk::PhysicalDeviceVulkan12Features::default();
        let mut features = Features2::default().push_next(&mut newer);
        // SAFETY: the device knows the chained structure, which came with its version.
        unsafe { instance.get_physical_device_features2(self.handle, &mut features) };
        newer.subgroup_broadcast_dynamic_id == vk::TRUE
    }

    /// Whether density maps are there, also for images that were not made for them: a headset's are the runtime's, and not
    /// subsampled.
    fn density_maps(&self, instance: &ash::Instance) -> bool {
        if !contains(&self.extensions, ext::fragment_density_map::NAME) {
            return false;
        }
        let mut maps = vk::PhysicalDeviceFragmentDensityMapFeaturesEXT::default();
        let mut features = Features2::default().push_next(&mut maps);
        // SAFETY: the device knows the chained structure (extension checked).
        unsafe { instance.get_physical_device_features2(self.handle, &mut features) };
        maps.fragment_density_map == vk::TRUE
            && maps.fragment_density_map_non_subsampled_images == vk::TRUE
    }

    /// The first family that both draws and computes.
    fn queue_family(
        &self,
        instance: &ash::Instance,
    ) -> Result<(u32, vk::QueueFamilyProperties), VulkanError> {
        // SAFETY: the handle belongs to this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(self.handle) };
        let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        (0..)
            .zip(families)
            .find(|(_, family)| family.queue_flags.contains(wanted))
            .ok_or_else(|| self.lacks("a queue family for both graphics and compute"))
    }

    /// The subgroup size to compile for, if the device's limits suit the shaders.
    fn subgroup(&self, instance: &ash::Instance) -> Result<Subgroup, VulkanError> {
        if self.api_version < vk::API_VERSION_1_1 {
            return Err(self.lacks("Vulkan 1.1"));
        }
        let mut base = vk::PhysicalDeviceSubgroupProperties::default();
        let mut control = vk::PhysicalDeviceSubgroupSizeControlProperties::default();
        let mut control_features = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut base);
        let has_control = self.has_subgroup_size_control();
        if has_control {
            properties = properties.push_next(&mut control);
            let mut features = Features2::default().push_next(&mut control_features);
            // SAFETY: the device knows the chained structure (extension or version checked).
            unsafe { instance.get_physical_device_features2(self.handle, &mut features) };
        }
        // SAFETY: as above.
        unsafe { instance.get_physical_device_properties2(self.handle, &mut properties) };

        use vk::SubgroupFeatureFlags as Feature;
        let mut lacks: Vec<String> = [
            (Feature::BASIC, "basic"),
            (Feature::VOTE, "vote"),
            (Feature::ARITHMETIC, "arithmetic"),
            (Feature::BALLOT, "ballot"),
            (Feature::SHUFFLE, "shuffle"),
        ]
        .into_iter()
        .filter(|(feature, _)| !base.supported_operations.contains(*feature))
        .map(|(_, name)| format!("subgroup {name} operations"))
        .collect();
        if !base
            .supported_stages
            .contains(vk::ShaderStageFlags::COMPUTE)
        {
            lacks.push("subgroup operations in compute shaders".to_owned());
        }
        let size = base.subgroup_size;
        if !(4..=128).contains(&size) || !size.is_power_of_two() {
            lacks.push(format!("a subgroup size of 4 to 128 (it has {size})"));
        }
        let buffers = self.limits.max_per_stage_descriptor_storage_buffers;
        if buffers < STORAGE_BUFFERS {
            lacks.push(format!(
                "{STORAGE_BUFFERS} storage buffers in a shader (it has {buffers})"
            ));
        }
        if self.limits.max_compute_work_group_invocations < 256 {
            lacks.push("256 invocations in a compute workgroup".to_owned());
        }
        let [width, ..] = self.limits.max_compute_work_group_size;
        if width < 256 {
            lacks.push(format!("compute workgroups 256 wide (it has {width})"));
        }
        if !lacks.is_empty() {
            return Err(VulkanError::Unsupported {
                device: self.info.name.clone(),
                lacks,
            });
        }
        let can_be_required = has_control
            && control_features.subgroup_size_control == vk::TRUE
            && control_features.compute_full_subgroups == vk::TRUE
            && control
                .required_subgroup_size_stages
                .contains(vk::ShaderStageFlags::COMPUTE)
            && (control.min_subgroup_size..=control.max_subgroup_size).contains(&size);
        Ok(Subgroup {
            size,
            can_be_required,
        })
    }

    /// Whether the structures of subgroup size control may be chained.
    fn has_subgroup_size_control(&self) -> bool {
        self.api_version >= vk::API_VERSION_1_3
            || contains(&self.extensions, ext::subgroup_size_control::NAME)
    }
}
