//! What can go wrong between this program and a headset, each with what to do about it.

use openxr::sys::Result as XrResult;

use crate::{RenderError, advice};

/// Why there is no headset, or no longer one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XrError {
    /// There is no `OpenXR` loader on this machine.
    #[error(
        "no OpenXR loader (libopenxr_loader.so.1) found ({0}): {advice}",
        advice = advice::OPENXR_LOADER
    )]
    NoLoader(String),
    /// The loader finds no runtime, or cannot load the one that its manifest names.
    #[error("no OpenXR runtime is active ({result}): {}", advice::OPENXR_RUNTIME)]
    NoRuntime {
        /// What the loader said.
        result: XrResult,
    },
    /// The runtime is there, but the service behind it is not.
    #[error(
        "the OpenXR runtime does not answer ({result}): its service is not running: {}",
        advice::OPENXR_SERVICE
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
    /// The runtime lacks what pictures cannot be shown without.
    #[error(
        "{runtime} cannot show our pictures: it lacks {lacks}; {}",
        advice::OTHER_RUNTIME
    )]
    Unsupported {
        /// The runtime's name.
        runtime: String,
        /// What is missing.
        lacks: String,
    },
    /// The runtime went away, or is about to: everything made with it is to be let go, and made again.
    #[error("the OpenXR runtime is gone ({call}: {result}): open the headset again")]
    Lost {
        /// What was being asked of it.
        call: &'static str,
        /// What it said.
        result: XrResult,
    },
    /// Any other failure of a call.
    #[error("{call} failed: {result}; {}", advice::RUNTIME_FAILED)]
    Call {
        /// The call.
        call: &'static str,
        /// What it returned.
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
        matches!(
            self,
            Self::Lost { .. } | Self::Render(RenderError::DeviceLost(_))
        )
    }

    /// Whether it may come by waiting: a service that is being started, a headset that is not worn yet.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        let by_vulkan = matches!(self, Self::Render(RenderError::HeadsetDevice { .. }));
        self.is_loss()
            || by_vulkan
            || matches!(self, Self::NoService { .. } | Self::NoHeadset { .. })
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
