//! A headset, and the Vulkan device that its runtime asks for.

use std::ffi::c_void;
use std::sync::Arc;

use ash::vk::{self, Handle};
use openxr::sys::Result as XrResult;
use openxr::{ApplicationInfo, FormFactor, Instance, SystemId, ViewConfigurationType, Vulkan};
use renderer_splat::limits::MOST_PIXELS;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::error::VkContext;
use renderer_vulkan::factory::{VulkanFactory, instance_error};
use renderer_vulkan::gpu::Gpu;

use crate::error::{XrContext, XrError};
use crate::extensions::Extensions;
use crate::runtime::{Runtime, no_runtime};

/// The views there are: one for each eye.
pub(crate) const VIEWS: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;

/// A headset of the active runtime.
pub struct Headset {
    gpu: Arc<Gpu>,
    pub(crate) instance: Instance,
    pub(crate) system: SystemId,
    extensions: Extensions,
    info: HeadsetInfo,
    eye: vk::Extent2D,
}

/// Facts about a headset, for people and for reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeadsetInfo {
    /// The runtime's name and version.
    pub runtime: String,
    /// The headset's name, as the runtime gives it.
    pub name: String,
    /// Width and height of an eye's picture, pixels.
    pub eye_size: [u32; 2],
}

impl std::fmt::Debug for Headset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Headset")
            .field("info", &self.info)
            .field("gpu", &self.gpu)
            .finish_non_exhaustive()
    }
}

/// How a headset is opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HeadsetOptions {
    /// Width and height of an eye's picture, instead of what the runtime recommends; no larger than it takes.
    pub eye_size: Option<[u32; 2]>,
    /// Whether the validation layer's messages are logged and counted.
    pub validation: bool,
}

impl Headset {
    /// Finds the headset and opens Vulkan for it.
    ///
    /// # Errors
    /// No runtime, no service behind it, no headset, no Vulkan device that can draw: each says what to do.
    pub fn open(runtime: &Runtime, options: HeadsetOptions) -> Result<Self, XrError> {
        let entry = runtime.entry();
        let offered = entry.enumerate_extensions().map_err(no_runtime)?;
        let extensions = Extensions::of(&offered)?;
        let application = ApplicationInfo {
            application_name: "mon3tr",
            engine_name: "mon3tr",
            api_version: openxr::Version::new(1, 0, 0),
            ..ApplicationInfo::default()
        };
        let instance = runtime
            .instance(&application, extensions.set())
            .map_err(no_runtime)?;
        let properties = instance.properties().during("xrGetInstanceProperties")?;
        let version = properties.runtime_version;
        let runtime = format!(
            "{} {}.{}.{}",
            properties.runtime_name,
            version.major(),
            version.minor(),
            version.patch()
        );
        let system = match instance.system(FormFactor::HEAD_MOUNTED_DISPLAY) {
            Ok(system) => system,
            Err(
                result @ (XrResult::ERROR_FORM_FACTOR_UNAVAILABLE
                | XrResult::ERROR_FORM_FACTOR_UNSUPPORTED),
            ) => return Err(XrError::NoHeadset { runtime, result }),
            Err(result) => return Err(result).during("xrGetSystem"),
        };
        let name = instance
            .system_properties(system)
            .during("xrGetSystemProperties")?
            .system_name;
        let eye = eye_size(&instance, system, &runtime, options.eye_size)?;
        let requirements = instance
            .graphics_requirements::<Vulkan>(system)
            .during("xrGetVulkanGraphicsRequirements2KHR")?;
        let newest = requirements.max_api_version_supported;
        let factory = RuntimeFactory {
            instance: &instance,
            system,
            newest: vk::make_api_version(0, newest.major().into(), newest.minor().into(), 0xFFF),
        };
        let gpu = Gpu::open_with(&factory, &GpuChoice::default(), options.validation)?;
        log::info!(
            "headset: {name} of {runtime}, {}x{} an eye",
            eye.width,
            eye.height
        );
        Ok(Self {
            gpu,
            instance,
            system,
            extensions,
            info: HeadsetInfo {
                runtime,
                name,
                eye_size: [eye.width, eye.height],
            },
            eye,
        })
    }

    /// The device to draw on.
    #[must_use]
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Names and sizes.
    #[must_use]
    pub fn info(&self) -> &HeadsetInfo {
        &self.info
    }

    /// Optional extensions, granted and missing.
    #[must_use]
    pub fn extensions(&self) -> &Extensions {
        &self.extensions
    }

    pub(crate) fn eye(&self) -> vk::Extent2D {
        self.eye
    }
}

/// The size of an eye's picture: the wanted one, else what the runtime recommends, even and within what can be drawn.
fn eye_size(
    instance: &Instance,
    system: SystemId,
    runtime: &str,
    wanted: Option<[u32; 2]>,
) -> Result<vk::Extent2D, XrError> {
    let views = instance
        .enumerate_view_configuration_views(system, VIEWS)
        .during("xrEnumerateViewConfigurationViews")?;
    let [left, right] = views[..] else {
        return Err(XrError::Unsupported {
            runtime: runtime.to_owned(),
            lacks: format!("two eyes (it has {} views)", views.len()),
        });
    };
    // Both eyes' pictures lie in one array.
    let recommended = [
        (left.recommended_image_rect_width).max(right.recommended_image_rect_width),
        (left.recommended_image_rect_height).max(right.recommended_image_rect_height),
    ];
    let most = [
        (left.max_image_rect_width).min(right.max_image_rect_width),
        (left.max_image_rect_height).min(right.max_image_rect_height),
    ];
    let [width, height] = wanted.unwrap_or(recommended);
    let side = |wanted: u32, most: u32| wanted.min(most).clamp(16, MOST_PIXELS) & !1;
    Ok(vk::Extent2D {
        width: side(width, most[0]),
        height: side(height, most[1]),
    })
}

/// Vulkan as the runtime makes it (`XR_KHR_vulkan_enable2`).
struct RuntimeFactory<'a> {
    instance: &'a Instance,
    system: SystemId,
    newest: u32,
}

impl VulkanFactory for RuntimeFactory<'_> {
    type Error = XrError;

    fn newest_version(&self) -> u32 {
        self.newest
    }

    fn adds_features(&self) -> bool {
        true
    }

    fn instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<ash::Instance, XrError> {
        let made = {
            let info: *const vk::InstanceCreateInfo<'_> = info;
            // SAFETY: the description lives until the call returns; the loader is the one it was written for.
            unsafe {
                self.instance
                    .create_vulkan_instance(self.system, loader(entry), info.cast())
            }
        };
        let handle = answer("xrCreateVulkanInstanceKHR", made)?.map_err(instance_error)?;
        // SAFETY: the runtime made the instance with this loader just now.
        Ok(
            unsafe {
                ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(handle as u64))
            },
        )
    }

    fn wanted_device(
        &self,
        instance: &ash::Instance,
    ) -> Result<Option<vk::PhysicalDevice>, XrError> {
        let handle = instance.handle().as_raw() as *const c_void;
        // SAFETY: the runtime made this instance.
        let wanted = unsafe { self.instance.vulkan_graphics_device(self.system, handle) };
        let wanted = wanted.map_err(|result| XrError::HeadsetDevice {
            call: "xrGetVulkanGraphicsDevice2KHR",
            result,
        })?;
        Ok(Some(vk::PhysicalDevice::from_raw(wanted as u64)))
    }

    fn device(
        &self,
        entry: &ash::Entry,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<ash::Device, XrError> {
        let physical = physical.as_raw() as *const c_void;
        let made = {
            let info: *const vk::DeviceCreateInfo<'_> = info;
            // SAFETY: the description lives until the call returns; the device is the one that the runtime asked for.
            unsafe {
                self.instance.create_vulkan_device(
                    self.system,
                    loader(entry),
                    physical,
                    info.cast(),
                )
            }
        };
        let handle = VkContext::during(answer("xrCreateVulkanDeviceKHR", made)?, "vkCreateDevice")?;
        // SAFETY: the runtime made the device of this instance just now.
        Ok(unsafe { ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(handle as u64)) })
    }
}

/// The loader's function as `OpenXR` takes it.
fn loader(entry: &ash::Entry) -> openxr::sys::platform::VkGetInstanceProcAddr {
    let function = entry.static_fn().get_instance_proc_addr;
    // SAFETY: the same C function, whose handle is a pointer in one description and a transparent struct of one in the other.
    unsafe {
        std::mem::transmute::<
            vk::PFN_vkGetInstanceProcAddr,
            openxr::sys::platform::VkGetInstanceProcAddr,
        >(function)
    }
}

/// A runtime's answer, and Vulkan's in it.
fn answer<T>(
    call: &'static str,
    made: openxr::Result<Result<T, openxr::sys::platform::VkResult>>,
) -> Result<Result<T, vk::Result>, XrError> {
    made.map(|made| made.map_err(vk::Result::from_raw))
        .map_err(|result| XrError::HeadsetDevice { call, result })
}
