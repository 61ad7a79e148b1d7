//! A window as Vulkan sees it.

use std::any::Any;
use std::sync::Arc;

use ash::{ext, khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// A surface, and the window it belongs to, kept alive with it.
pub struct Surface {
    gpu: Arc<Gpu>,
    pub(crate) loader: khr::surface::Instance,
    pub(crate) handle: vk::SurfaceKHR,
    _window: Option<Arc<dyn Any + Send + Sync>>,
}

impl std::fmt::Debug for Surface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surface")
            .field("handle", &self.handle)
            .finish_non_exhaustive()
    }
}

/// The error that says why a window cannot be presented to.
pub fn no_presentation(gpu: &Gpu, why: impl Into<String>) -> VulkanError {
    VulkanError::NoPresentation {
        device: gpu.info().name.clone(),
        why: why.into(),
    }
}

impl Surface {
    /// The surface of a window.
    ///
    /// # Errors
    /// [`VulkanError::NoPresentation`] where the device or its driver cannot show pictures in it.
    pub fn of_window<W>(gpu: &Arc<Gpu>, window: Arc<W>) -> Result<Self, VulkanError>
    where
        W: HasWindowHandle + HasDisplayHandle + Send + Sync + 'static,
    {
        let entry = &gpu.instance.entry;
        let instance = &gpu.instance.handle;
        let display = window
            .display_handle()
            .map_err(|why| no_presentation(gpu, why.to_string()))?;
        let raw = window
            .window_handle()
            .map_err(|why| no_presentation(gpu, why.to_string()))?;
        let needed = ash_window::enumerate_required_extensions(display.as_raw()).map_err(|_| {
            no_presentation(gpu, "no Vulkan extension is known for its windowing system")
        })?;
        for name in needed {
            // SAFETY: ash-window gives static, NUL-terminated names.
            let name = unsafe { std::ffi::CStr::from_ptr(*name) };
            if !gpu.instance.surface_extensions.contains(&name) {
                return Err(no_presentation(
                    gpu,
                    format!("{} is missing", name.to_string_lossy()),
                ));
            }
        }
        // SAFETY: the handles are of a live window, which the surface keeps alive; the extension is enabled.
        let handle = unsafe {
            ash_window::create_surface(entry, instance, display.as_raw(), raw.as_raw(), None)
        }
        .during("creating a window surface")?;
        Self::new(gpu, handle, Some(window))
    }

    /// A surface without a window (`VK_EXT_headless_surface`).
    ///
    /// # Errors
    /// [`VulkanError::NoPresentation`] without `VK_EXT_headless_surface`.
    pub fn headless(gpu: &Arc<Gpu>) -> Result<Self, VulkanError> {
        if !gpu
            .instance
            .surface_extensions
            .contains(&ext::headless_surface::NAME)
        {
            return Err(no_presentation(gpu, "VK_EXT_headless_surface is missing"));
        }
        let loader =
            ext::headless_surface::Instance::new(&gpu.instance.entry, &gpu.instance.handle);
        let info = vk::HeadlessSurfaceCreateInfoEXT::default();
        // SAFETY: the extension is enabled.
        let handle = unsafe { loader.create_headless_surface(&info, None) }
            .during("vkCreateHeadlessSurfaceEXT")?;
        Self::new(gpu, handle, None)
    }

    fn new(
        gpu: &Arc<Gpu>,
        handle: vk::SurfaceKHR,
        window: Option<Arc<dyn Any + Send + Sync>>,
    ) -> Result<Self, VulkanError> {
        let loader = khr::surface::Instance::new(&gpu.instance.entry, &gpu.instance.handle);
        let surface = Self {
            gpu: Arc::clone(gpu),
            loader,
            handle,
            _window: window,
        };
        if !gpu.has_swapchain {
            return Err(no_presentation(gpu, "it has no swapchains"));
        }
        // SAFETY: family and surface belong to this instance.
        let supported = unsafe {
            surface.loader.get_physical_device_surface_support(
                gpu.physical,
                gpu.queue_family,
                surface.handle,
            )
        }
        .during("vkGetPhysicalDeviceSurfaceSupportKHR")?;
        if supported {
            Ok(surface)
        } else {
            Err(no_presentation(gpu, "its queue cannot reach the window"))
        }
    }

    pub(crate) fn capabilities(&self) -> Result<vk::SurfaceCapabilitiesKHR, VulkanError> {
        // SAFETY: the surface is alive.
        unsafe {
            self.loader
                .get_physical_device_surface_capabilities(self.gpu.physical, self.handle)
        }
        .during("vkGetPhysicalDeviceSurfaceCapabilitiesKHR")
    }

    /// A format of four 8-bit channels that are shown as they are written, and its colour space.
    ///
    /// # Errors
    /// [`VulkanError::NoPresentation`] where there is no such format.
    pub fn format(&self) -> Result<vk::SurfaceFormatKHR, VulkanError> {
        // SAFETY: the surface is alive.
        let formats = unsafe {
            self.loader
                .get_physical_device_surface_formats(self.gpu.physical, self.handle)
        }
        .during("vkGetPhysicalDeviceSurfaceFormatsKHR")?;
        let wanted = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
        formats
            .into_iter()
            .find(|offered| {
                wanted.contains(&offered.format)
                    && offered.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR
            })
            .ok_or_else(|| no_presentation(&self.gpu, "it offers no 8-bit UNORM format"))
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: its swapchain is dropped before.
        unsafe { self.loader.destroy_surface(self.handle, None) };
    }
}
