//! The validation layer's messages: logged, and counted so that a test can demand none.

use std::ffi::{CStr, c_void};
use std::sync::atomic::{AtomicU32, Ordering};

use ash::{ext, vk};

use crate::error::{VkContext, VulkanError};

pub(crate) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Receives messages of one instance from its making to its end.
pub(crate) struct Messenger {
    loader: ext::debug_utils::Instance,
    handle: vk::DebugUtilsMessengerEXT,
    // Boxed: the driver holds its address.
    count: Box<AtomicU32>,
}

impl Messenger {
    pub(crate) fn new(entry: &ash::Entry, instance: &ash::Instance) -> Result<Self, VulkanError> {
        let loader = ext::debug_utils::Instance::new(entry, instance);
        let count = Box::new(AtomicU32::new(0));
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE
                    | vk::DebugUtilsMessageTypeFlagsEXT::GENERAL,
            )
            .pfn_user_callback(Some(receive))
            .user_data((&raw const *count).cast_mut().cast());
        // SAFETY: the counter outlives the messenger (both are freed with self, the messenger first).
        let handle = unsafe { loader.create_debug_utils_messenger(&info, None) }
            .during("vkCreateDebugUtilsMessengerEXT")?;
        Ok(Self {
            loader,
            handle,
            count,
        })
    }

    pub(crate) fn count(&self) -> u32 {
        self.count.load(Ordering::Relaxed)
    }
}

impl Drop for Messenger {
    fn drop(&mut self) {
        // SAFETY: the instance still lives: `Gpu` drops it after its messenger.
        unsafe { self.loader.destroy_debug_utils_messenger(self.handle, None) };
    }
}

unsafe extern "system" fn receive(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    count: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure with a null or NUL-terminated message.
    let message = unsafe {
        let text = (*data).p_message;
        if text.is_null() {
            "".into()
        } else {
            CStr::from_ptr(text).to_string_lossy()
        }
    };
    // General messages are the loader's (a driver file that is missing, say), not about our calls.
    if kind == vk::DebugUtilsMessageTypeFlagsEXT::GENERAL {
        log::debug!("Vulkan loader: {message}");
        return vk::FALSE;
    }
    // SAFETY: the user data is the counter given at creation, which outlives the messenger.
    unsafe { &*count.cast::<AtomicU32>() }.fetch_add(1, Ordering::Relaxed);
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
        log::error!("Vulkan validation: {message}");
    } else {
        log::warn!("Vulkan validation: {message}");
    }
    vk::FALSE
}
