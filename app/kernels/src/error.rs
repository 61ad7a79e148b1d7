//! What the kernels refuse.

use spmm3::{PackageError, PersonError};

/// Inputs that do not fit the avatar, or one another.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KernelError {
    /// The deform graph's results do not fit the avatar.
    #[error("the deform graph's results do not fit the avatar")]
    Person(#[from] PersonError),
    /// A list of Gaussians to draw is not in ascending order.
    #[error("the Gaussians to draw must be listed in ascending order, each once")]
    Order,
    /// A [`crate::Poser`] that was made for residuals got F_attr's potentials.
    #[error(
        "this poser was made without F_attr's bases: make it with Poser::with_tail to use potentials"
    )]
    NoTail,
    /// The avatar's networks cannot be had from its package.
    #[error("the avatar's networks cannot be read")]
    Package(#[from] PackageError),
}
