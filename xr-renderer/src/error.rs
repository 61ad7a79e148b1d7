//! What can go wrong on the way to a picture, each with what to do about it.

use ash::vk;

use crate::advice;

/// Why the renderer could not open a device or draw.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// There is no Vulkan loader on this machine.
    #[error(
        "no Vulkan loader (libvulkan) found ({0}): {advice}",
        advice = advice::VULKAN_LOADER
    )]
    NoLoader(String),
    /// The loader finds no driver, or no driver finds a device.
    #[error("no Vulkan device found: {}", advice::VULKAN_DEVICE)]
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
    #[error("{device} cannot run the splat shaders: it lacks {}; {}", lacks.join(", "), advice::OTHER_DEVICE)]
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
    /// More Gaussians than the renderer was made for, or than any on this device can take.
    #[error(
        "{count} Gaussians are more than the {limit} that this renderer can take: use fewer Gaussians"
    )]
    TooManyGaussians {
        /// How many were given.
        count: usize,
        /// How many fit.
        limit: u32,
    },
    /// The parts of a mesh with Gaussians do not fit together.
    #[error("Gaussians cannot be posed with this mesh: {0}; give arrays of one avatar")]
    BoundMesh(String),
    /// A pose is not of the mesh it was given for.
    #[error(
        "a pose has {got} {what}, but its mesh needs {expected}: give the outputs of the same avatar's networks"
    )]
    PosedInput {
        /// What there are too few or too many of.
        what: &'static str,
        /// How many were given.
        got: usize,
        /// How many the mesh needs.
        expected: usize,
    },
    /// A state was asked for that is not on the device.
    #[error(
        "the state is not on the device: push a pose, draw before four more are pushed, and push anew after `recover`"
    )]
    NoState,
    /// A posed foreground was asked of a renderer that has no mesh.
    #[error("the renderer has no mesh to pose: make it with `RendererOptions::mesh` set")]
    NoMesh,
    /// A slot's memory is another device's than the renderer's.
    #[error(
        "the foreground slot belongs to another device than the renderer: make slots with `foreground_slot` of the renderer that draws them, and new ones after `recover`"
    )]
    ForeignSlot,
    /// A foreground of more parts than can be drawn at once.
    #[error(
        "a foreground of {parts} parts cannot be drawn, at most {}: put Gaussians that move together into one slot",
        crate::drawing::MOST_PARTS
    )]
    TooManyParts {
        /// How many were given.
        parts: usize,
    },
    /// A part is placed by something else than a turn and a shift.
    #[error(
        "part {part} of the foreground cannot be drawn: its `world_from_part` is not rigid or not finite; give a turn and a shift alone, and bake sizes into the Gaussians"
    )]
    PartNotRigid {
        /// Which one, from 0.
        part: usize,
    },
    /// Two parts show the mesh.
    #[error(
        "two parts of the foreground are posed on the device, which holds one mesh: write all people but one to slots"
    )]
    PosedTwice,
    /// The picture went into a headset's images and nowhere else.
    #[error(
        "the picture was drawn straight into the headset's images, not the renderer's own: read it back from the session"
    )]
    NotKept,
    /// The Gaussians cover too many tiles together.
    #[error(
        "the Gaussians cover {pairs} screen tiles together, more than the {limit} that fit: use fewer or smaller Gaussians, or a smaller picture"
    )]
    TooManyPairs {
        /// (Gaussian, tile) pairs in the picture; `u32::MAX` stands for that or more.
        pairs: u32,
        /// How many the device's largest buffer holds.
        limit: u32,
    },
    /// The picture's size or number of views cannot be drawn.
    #[error(
        "cannot draw {views} view(s) of {width}x{height} pixels: 1 or 2 views of 1x1 to 4096x4096 can be drawn"
    )]
    PictureSize {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Views.
        views: u32,
    },
    /// A camera does not fit the picture or is no camera.
    #[error(
        "camera {view} cannot be drawn with: {problem}; give each view of the renderer one rigid camera with finite numbers and a size that fits"
    )]
    Camera {
        /// Which view's camera.
        view: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// The quad back end was asked for where its shaders crash the driver.
    #[error(
        "llvmpipe crashes on the quads' shaders with vectors of 512 bits: draw by tiles, or set LP_NATIVE_VECTOR_WIDTH=256"
    )]
    NoQuads,
    /// Depth was asked for but not drawn.
    #[error("the renderer draws no depth: make it with `RendererOptions::depth` set")]
    NoDepth,
    /// There is no such view to read.
    #[error("view {view} does not exist: the renderer has {views}")]
    NoSuchView {
        /// What was asked for.
        view: u32,
        /// How many there are.
        views: u32,
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
    /// The driver gave the device up.
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
        /// How long we waited.
        seconds: u64,
    },
    /// The headset's runtime does not make a Vulkan device, or gave up while it did.
    #[error(
        "the headset's runtime failed to open Vulkan for us ({call}: {result}): is its service running, and does VK_DRIVER_FILES name the same driver for both?"
    )]
    HeadsetDevice {
        /// What was asked of it.
        call: &'static str,
        /// What it said.
        result: openxr::sys::Result,
    },
    /// Any other failure of a Vulkan call.
    #[error("{call} failed: {result}; update the device's driver or try --gpu lavapipe")]
    Vulkan {
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
pub(crate) trait VkContext<T> {
    /// The value, or the error that tells what to do.
    fn during(self, call: &'static str) -> Result<T, RenderError>;
}

impl<T> VkContext<T> for Result<T, vk::Result> {
    fn during(self, call: &'static str) -> Result<T, RenderError> {
        self.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => RenderError::DeviceLost(call),
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                RenderError::OutOfMemoryDuring(call)
            }
            result => RenderError::Vulkan { call, result },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_memory_tells_how_much_is_needed_taken_and_there_and_what_to_lower() {
        let error = RenderError::OutOfMemory {
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
