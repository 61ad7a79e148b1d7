//! The Vulkan loader and instance.

use std::ffi::CStr;

use ash::{ext, khr, vk};

use crate::error::{VkContext, VulkanError};
use crate::factory::VulkanFactory;
use crate::validation;

/// The loader and the instance made from it.
pub(crate) struct Instance {
    pub(crate) entry: ash::Entry,
    pub(crate) handle: ash::Instance,
    /// Extensions enabled for making surfaces.
    pub(crate) surface_extensions: Vec<&'static CStr>,
}

/// Surface extensions are taken where offered, so that a window can be opened later.
const WANTED: [&CStr; 5] = [
    khr::surface::NAME,
    khr::xlib_surface::NAME,
    khr::xcb_surface::NAME,
    khr::wayland_surface::NAME,
    ext::headless_surface::NAME,
];

impl Instance {
    pub(crate) fn new<F: VulkanFactory>(
        factory: &F,
        with_validation: bool,
    ) -> Result<Self, F::Error> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers; it is what it claims to be.
        let entry =
            unsafe { ash::Entry::load() }.map_err(|e| VulkanError::NoLoader(e.to_string()))?;
        // SAFETY: no preconditions.
        let offered_version = unsafe { entry.try_enumerate_instance_version() }
            .during("vkEnumerateInstanceVersion")?
            .unwrap_or(vk::API_VERSION_1_0);
        let application = vk::ApplicationInfo::default()
            .application_name(c"mon3tr")
            .api_version(
                offered_version
                    .min(factory.newest_version())
                    .clamp(vk::API_VERSION_1_1, vk::API_VERSION_1_3),
            );

        // SAFETY: no preconditions.
        let offered = unsafe { entry.enumerate_instance_extension_properties(None) }
            .during("vkEnumerateInstanceExtensionProperties")?;
        let surface_extensions: Vec<&'static CStr> = WANTED
            .into_iter()
            .filter(|wanted| contains(&offered, wanted))
            .collect();
        let mut extensions = surface_extensions.clone();
        let mut layers = Vec::new();
        if with_validation {
            // SAFETY: no preconditions.
            let present = unsafe { entry.enumerate_instance_layer_properties() }
                .during("vkEnumerateInstanceLayerProperties")?;
            if !present
                .iter()
                .any(|layer| layer.layer_name_as_c_str() == Ok(validation::LAYER))
            {
                return Err(VulkanError::NoValidationLayer.into());
            }
            layers.push(validation::LAYER.as_ptr());
            extensions.push(ext::debug_utils::NAME);
            extensions.push(ext::validation_features::NAME);
        }
        let extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if with_validation {
            info = info.push_next(&mut features);
        }
        let handle = factory.instance(&entry, &info)?;
        Ok(Self {
            entry,
            handle,
            surface_extensions,
        })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: `Gpu` drops its device and messenger before its instance.
        unsafe { self.handle.destroy_instance(None) };
    }
}

/// Whether an extension is among those offered.
pub(crate) fn contains(offered: &[vk::ExtensionProperties], wanted: &CStr) -> bool {
    offered
        .iter()
        .any(|extension| extension.extension_name_as_c_str() == Ok(wanted))
}
