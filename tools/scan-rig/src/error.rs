//! What can go wrong between a scan and an avatar.

/// Why a scan did not become an avatar.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// No avatar can be made of it.
    #[error("{what}")]
    Unsuited {
        /// What is missing, and what to do.
        what: String,
    },
    /// The body model cannot be built.
    #[error("cannot build the body model: {0}")]
    Body(#[from] reconstruct::ReconstructError),
    /// A network failed.
    #[error("cannot look at the scan: {0}")]
    Tracker(#[from] tracker::TrackerError),
    /// Networks cannot be run at all.
    #[error("cannot look at the scan: {0}")]
    Runtime(#[from] npu_runtime::RuntimeError),
    /// Drawing the scan failed.
    #[error("cannot draw the scan: {0}")]
    Draw(#[from] renderer_splat::error::RenderError),
    /// The parts of the avatar do not fit each other: a fault of this program.
    #[error("cannot assemble the avatar: {0}")]
    Person(#[from] spmm3::PersonError),
}

impl From<renderer_vulkan::error::VulkanError> for RigError {
    fn from(error: renderer_vulkan::error::VulkanError) -> Self {
        Self::Draw(error.into())
    }
}

impl RigError {
    /// A scan that is no use, and what to do.
    pub fn unsuited(what: impl Into<String>) -> Self {
        Self::Unsuited { what: what.into() }
    }
}
