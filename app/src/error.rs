//! What can stop the receiver.

use npu_runtime::RuntimeError;
use spmm3::PersonError;
use xr_renderer::RenderError;

/// An error on a frame's way from motion to picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReceiverError {
    /// The deform graph could not be loaded or run.
    #[error("cannot deform the avatar")]
    Deform(#[from] RuntimeError),
    /// The deform graph's results do not fit the avatar.
    #[error("the deform graph's results do not fit the avatar")]
    Person(#[from] PersonError),
    /// The renderer failed.
    #[error("cannot draw the avatar")]
    Render(#[from] RenderError),
}
