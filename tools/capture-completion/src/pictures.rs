//! Photographs of synchronous cameras, camera by camera and in order: what both folders and videos can give.

use crate::error::CompletionError;
use capture::{Camera, Capture, Photograph};

/// Takes a photograph and the number of its frame.
pub type Take<'a> = dyn FnMut(usize, Photograph) -> Result<(), CompletionError> + 'a;

/// Synchronous cameras' photographs.
pub trait Pictures {
    /// The cameras of the photographs: without distortion.
    fn cameras(&self) -> &[Camera];

    /// Frames of each camera.
    fn frames(&self) -> usize;

    /// Frames a second.
    fn frame_rate(&self) -> f64;

    /// Whether the cameras' poses are known. They are not for a single video: the world then follows from the fit of the person.
    fn posed(&self) -> bool;

    /// Hands over all photographs of a camera in order.
    ///
    /// # Errors
    /// Those of reading, and of `take`, which ends it.
    fn each(&mut self, camera: usize, take: &mut Take<'_>) -> Result<(), CompletionError>;
}

/// The photographs of a capture, or of some consecutive frames of it.
#[derive(Debug)]
pub struct OfCapture<'a> {
    capture: &'a Capture,
    cameras: Vec<Camera>,
    first: usize,
    frames: usize,
}

impl<'a> OfCapture<'a> {
    /// `frames` frames from frame `first` on, as far as there are.
    #[must_use]
    pub fn new(capture: &'a Capture, first: usize, frames: usize) -> Self {
        let first = first.min(capture.frames());
        Self {
            capture,
            cameras: capture.cameras().iter().map(Camera::undistorted).collect(),
            first,
            frames: frames.min(capture.frames() - first),
        }
    }
}

impl Pictures for OfCapture<'_> {
    fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn frame_rate(&self) -> f64 {
        self.capture.frame_rate()
    }

    fn posed(&self) -> bool {
        true
    }

    fn each(&mut self, camera: usize, take: &mut Take<'_>) -> Result<(), CompletionError> {
        for frame in 0..self.frames {
            take(frame, self.capture.photograph(camera, self.first + frame)?)?;
        }
        Ok(())
    }
}
