//! How large scenes may be.

/// The most Gaussians a scene may have.
pub const MAX_GAUSSIANS: usize = 1 << 22;

/// The largest file that is read: twice what 3DGS writes for [`MAX_GAUSSIANS`] of SH degree 3.
pub const MAX_FILE_BYTES: u64 = 2 << 30;
