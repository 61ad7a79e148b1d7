//! The errors of making a capture.

use std::path::PathBuf;

/// Why a capture could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthesisError {
    /// An option is out of range, or options contradict one another.
    #[error("{0}")]
    Options(String),
    /// A camera stands so near that the person reaches past it.
    #[error(
        "camera {camera} stands {distance:.2} m from the person in frame {frame}, who must be at least {least} m away: \
         widen the ring of cameras or shorten the person's travel"
    )]
    TooNear {
        /// Its name.
        camera: String,
        /// Number of the frame.
        frame: usize,
        /// Along the camera's axis, metres.
        distance: f64,
        /// The least distance, metres.
        least: f64,
    },
    /// A texture of the person has no texels.
    #[error("the person's texture for {0:?} is empty: fetch the MakeHuman data again")]
    Texture(reconstruct::Part),
    /// The capture cannot be written.
    #[error("cannot write the capture")]
    Capture(#[from] capture::CaptureError),
    /// The truth cannot be written.
    #[error("cannot write {}: make sure that its folder exists and has room", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The built-in performance cannot be made.
    #[error("the built-in motion cannot be made")]
    Motion(#[from] spmm3::MotionError),
}
