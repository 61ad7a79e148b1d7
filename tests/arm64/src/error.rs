//! `app`'s error without the errors of networks, devices and runtimes: what the kernels return.

use spmm3::{PackageError, PersonError};

/// See `app/src/error.rs`.
#[derive(Debug, thiserror::Error)]
pub enum ReceiverError {
    /// The deform graph's results do not fit the avatar.
    #[error("the deform graph's results do not fit the avatar")]
    Person(#[from] PersonError),
    /// A list of Gaussians to draw is not in ascending order.
    #[error("the Gaussians to draw must be listed in ascending order, each once")]
    Order,
    /// F_attr's potentials came to a poser that was made for residuals.
    #[error("this poser was made without F_attr's bases")]
    NoTail,
    /// The avatar's networks cannot be had from its package.
    #[error("the avatar's networks cannot be read")]
    Package(#[from] PackageError),
}
