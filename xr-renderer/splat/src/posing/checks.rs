//! What the checks of a mesh's parts have in common.

use crate::error::RenderError;

/// Parts that do not fit together.
pub(super) fn refused(problem: String) -> RenderError {
    RenderError::BoundMesh(problem)
}

/// A count as shaders have it.
pub(super) fn fits(what: &str, count: usize) -> Result<u32, RenderError> {
    u32::try_from(count).map_err(|_| refused(format!("{count} {what} are too many")))
}
