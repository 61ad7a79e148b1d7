//! The errors of a Vulkan device, each with what to do about it.

use ash::vk;

use crate::advice::{UPDATE_HEADSET, advice};

/// Why a device could not be opened, or failed later.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VulkanError {
    /// There is no Vulkan loader on this machine.
    #[error(
        "no Vulkan loader (libvulkan) found ({0}): {advice}",
        advice = advice(
            "start through ./run, or install it and a driver (Debian, Ubuntu: `apt install libvulkan1 mesa-vulkan-drivers`)",
            UPDATE_HEADSET
        )
    )]
    NoLoader(String),
    /// The loader finds no driver, or no driver finds a device.
    #[error(
        "no Vulkan device found: {}",
        advice(
            "install a Vulkan driver (Debian, Ubuntu: `apt install mesa-vulkan-drivers`, which also has lavapipe for machines without \
             a GPU) or point VK_DRIVER_FILES at one",
            UPDATE_HEADSET
        )
    )]
    NoDevice,
    /// A device was asked for by name and none has it.
    #[error("no Vulkan device matches `{wanted}`; this machine has: {}", present.join(", "))]
    NoSuchDevice {
        /// What was asked for.
        wanted: String,
        /// Names of the devices there are.
        present: Vec<String>,
    },
    /// The device lacks something that the shaders need.
    #[error(
        "{device} cannot run the splat shaders: it lacks {}; {}",
        lacks.join(", "),
        advice("update its driver, choose another device, or try --gpu lavapipe", UPDATE_HEADSET)
    )]
    Unsupported {
        /// The device's name.
        device: String,
        /// What is missing.
        lacks: Vec<String>,
    },
    /// Validation was asked for but its layer is not installed.
    #[error(
        "the validation layer VK_LAYER_KHRONOS_validation is not installed (Debian, Ubuntu: `apt install vulkan-validationlayers`, or point VK_LAYER_PATH at it)"
    )]
    NoValidationLayer,
    /// The device has no memory left for a buffer or image.
    #[error(
        "out of device memory: {what} needs {} MiB, {} MiB are taken already, and the device has {} MiB in all: use fewer Gaussians (a smaller background, an avatar baked with fewer) or a smaller picture, or close other programs that use the device",
        mebibytes(*bytes), mebibytes(*taken), mebibytes(*heap)
    )]
    OutOfMemory {
        /// What the memory was for.
        what: &'static str,
        /// How much was asked for.
        bytes: u64,
        /// How much this process has of it.
        taken: u64,
        /// How much the device has for such things; 0 where it has none.
        heap: u64,
    },
    /// A call ran out of memory without saying what for.
    #[error(
        "out of memory during {0}: use fewer Gaussians or a smaller picture, or close other programs that use the device"
    )]
    OutOfMemoryDuring(&'static str),
    /// A buffer would be larger than the device lets a shader address.
    #[error(
        "{what} needs {bytes} bytes, more than the {limit} bytes one buffer may have on this device: use fewer Gaussians or a smaller picture"
    )]
    TooLarge {
        /// What the buffer was for.
        what: &'static str,
        /// How much was needed.
        bytes: u64,
        /// How much the device allows.
        limit: u64,
    },
    /// The device cannot show pictures in this window.
    #[error(
        "{device} cannot show pictures in this window: {why}; render to files instead, or choose another device"
    )]
    NoPresentation {
        /// The device's name.
        device: String,
        /// What is missing.
        why: String,
    },
    /// The driver reports the device as lost.
    #[error(
        "the Vulkan device was lost during {0} (driver crash, reset or removal): open it again"
    )]
    DeviceLost(&'static str),
    /// The device did not finish in time.
    #[error(
        "the Vulkan device did not finish {what} within {seconds} s: close other programs that use it, draw fewer Gaussians or a smaller picture; if it hangs, update its driver or try --gpu lavapipe"
    )]
    Timeout {
        /// What it was doing.
        what: &'static str,
        /// How long it was waited for.
        seconds: u64,
    },
    /// Any other failure of a Vulkan call.
    #[error("{call} failed: {result}; update the device's driver or try --gpu lavapipe")]
    Call {
        /// The call.
        call: &'static str,
        /// What it returned.
        result: vk::Result,
    },
}

/// Whole MiB, rounded up: nothing that was asked for is 0.
fn mebibytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

/// Adds to a Vulkan result the name of the call that gave it.
pub trait VkContext<T> {
    /// The value, or the error that tells what to do.
    fn during(self, call: &'static str) -> Result<T, VulkanError>;
}

impl<T> VkContext<T> for Result<T, vk::Result> {
    fn during(self, call: &'static str) -> Result<T, VulkanError> {
        self.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => VulkanError::DeviceLost(call),
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                VulkanError::OutOfMemoryDuring(call)
            }
            result => VulkanError::Call { call, result },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_out_of_memory_error_has_the_sizes_and_what_to_lower() {
        let error = VulkanError::OutOfMemory {
            what: "background colours",
            bytes: 96 << 20,
            taken: 900 << 20,
            heap: (1 << 30) - 1,
        };
        let text = error.to_string();
        for part in [
            "background colours needs 96 MiB",
            "900 MiB",
            "1024 MiB",
            "fewer Gaussians",
            "smaller picture",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
