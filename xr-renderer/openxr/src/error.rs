//! The errors of a headset, each with what to do about it.

use openxr::sys::Result as XrResult;
use renderer_splat::error::RenderError;
use renderer_vulkan::advice::{UPDATE_HEADSET, advice};
use renderer_vulkan::error::VulkanError;

/// Why there is no headset, or why it was lost.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XrError {
    /// There is no `OpenXR` loader on this machine.
    #[error(
        "no OpenXR loader (libopenxr_loader.so.1) found ({0}): {advice}",
        advice = advice(
            "start through ./run, or install it (Debian, Ubuntu: `apt install libopenxr-loader1`)",
            "the app's package lacks it: install the app anew"
        )
    )]
    NoLoader(String),
    /// The loader finds no runtime, or cannot load the one that its manifest names.
    #[error(
        "no OpenXR runtime is active ({result}): {}",
        advice(
            "start your headset's software and make it the active runtime, or point XR_RUNTIME_JSON at a runtime's manifest that exists \
             (Monado's, say)",
            UPDATE_HEADSET
        )
    )]
    NoRuntime {
        /// What the loader said.
        result: XrResult,
    },
    /// There is a runtime, but its service is not running.
    #[error(
        "the OpenXR runtime does not answer ({result}): its service is not running: {}",
        advice("start it (SteamVR, `monado-service`) and try again", UPDATE_HEADSET)
    )]
    NoService {
        /// What the runtime said.
        result: XrResult,
    },
    /// There is a runtime, and no headset.
    #[error(
        "{runtime} has no headset ({result}): connect it, put it on, or wake it, and try again"
    )]
    NoHeadset {
        /// The runtime's name.
        runtime: String,
        /// What it said.
        result: XrResult,
    },
    /// The runtime lacks something that showing pictures needs.
    #[error(
        "{runtime} cannot show our pictures: it lacks {lacks}; {}",
        advice("use another OpenXR runtime", UPDATE_HEADSET)
    )]
    Unsupported {
        /// The runtime's name.
        runtime: String,
        /// What is missing.
        lacks: String,
    },
    /// The runtime was lost, or is about to be: destroy everything made with it, and make it again.
    #[error("the OpenXR runtime is gone ({call}: {result}): open the headset again")]
    Lost {
        /// What was being asked of it.
        call: &'static str,
        /// What it said.
        result: XrResult,
    },
    /// Any other failure of a call.
    #[error(
        "{call} failed: {result}; {}",
        advice("restart the headset's software", "restart the headset")
    )]
    Call {
        /// The call.
        call: &'static str,
        /// What it returned.
        result: XrResult,
    },
    /// The headset's runtime did not make a Vulkan device.
    #[error(
        "the headset's runtime failed to open Vulkan for us ({call}: {result}): is its service running, and does VK_DRIVER_FILES name the same driver for both?"
    )]
    HeadsetDevice {
        /// What was asked of it.
        call: &'static str,
        /// What it said.
        result: XrResult,
    },
    /// Drawing for the headset failed.
    #[error("cannot draw for the headset")]
    Render(#[from] RenderError),
}

impl XrError {
    /// Whether the headset may come back by being opened again: its runtime or its device went away.
    #[must_use]
    pub fn is_loss(&self) -> bool {
        match self {
            Self::Lost { .. } => true,
            Self::Render(error) => error.is_device_lost(),
            _ => false,
        }
    }

    /// Whether waiting may help: the service is being started, or the headset is not worn yet.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        self.is_loss()
            || matches!(
                self,
                Self::HeadsetDevice { .. } | Self::NoService { .. } | Self::NoHeadset { .. }
            )
    }
}

impl From<VulkanError> for XrError {
    fn from(error: VulkanError) -> Self {
        Self::Render(error.into())
    }
}

/// Adds to a result of `OpenXR` the name of the call that gave it.
pub(crate) trait XrContext<T> {
    /// The value, or the error that tells what to do.
    fn during(self, call: &'static str) -> Result<T, XrError>;
}

impl<T> XrContext<T> for Result<T, XrResult> {
    fn during(self, call: &'static str) -> Result<T, XrError> {
        self.map_err(|result| match result {
            XrResult::ERROR_INSTANCE_LOST
            | XrResult::ERROR_SESSION_LOST
            | XrResult::ERROR_RUNTIME_FAILURE
            | XrResult::SESSION_LOSS_PENDING => XrError::Lost { call, result },
            result => XrError::Call { call, result },
        })
    }
}
