//! What can stop the receiver.

use crate::plan::Plan;
use app_kernels::KernelError;
use npu_runtime::RuntimeError;
use renderer_splat::error::RenderError;
use spmm3::PackageError;

/// An error on a frame's way from motion to picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReceiverError {
    /// The deform graph could not be loaded or run.
    #[error("cannot deform the avatar")]
    Deform(#[from] RuntimeError),
    /// The networks' results do not fit the avatar, or its parts one another.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The avatar's networks cannot be had from its package.
    #[error("the avatar's networks cannot be read")]
    Package(#[from] PackageError),
    /// The renderer failed.
    #[error("cannot draw the avatar")]
    Render(#[from] RenderError),
    /// More people than one picture has room for.
    #[error("there is no room for another person: one picture shows {most} at most")]
    TooManyPeople {
        /// How many there can be.
        most: usize,
    },
    /// A person beside the first was to be posed on the device.
    #[error(
        "only the first person can be posed on the device: choose a plan with the CPU's or the NPU's work for those who join"
    )]
    PosedTwice,
    /// People come and go, and a plan was asked for that poses one.
    #[error(
        "plan {0} is not to be had where people come and go: the device poses one person only; ask for auto, npu, cpu-tail or cpu"
    )]
    PosesOne(Plan),
    /// Nothing can run the deform graph.
    #[error("no provider is left to run the deform graph")]
    NoProvider,
    /// It was time to leave before it was done.
    #[error("left before it was done")]
    Left,
    /// A test made inference fail.
    #[error("made to fail")]
    Struck,
    /// No thread for a lane.
    #[error("cannot start a lane's thread")]
    Thread(#[source] std::io::Error),
    /// A lane ended without being stopped.
    #[error("a lane ended before its time")]
    LaneEnded,
    /// A lane panicked, which it says itself.
    #[error("the {0} panicked")]
    Panicked(String),
}

impl ReceiverError {
    /// The error with all that caused it, in a line.
    #[must_use]
    pub fn in_full(&self) -> String {
        in_full(self)
    }
}

/// An error with all that caused it, in a line.
pub fn in_full(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
