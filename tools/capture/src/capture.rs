//! A capture that is open.

use crate::camera::Camera;
use crate::decode::{self, Channels};
use crate::error::CaptureError;
use crate::held_out::HeldOut;
use crate::layouts::{self, Found};
use crate::photograph::Photograph;
use crate::pose::FramePose;
use crate::writer;
use spmm3::ExpressionBasis;
use std::path::{Path, PathBuf};

pub use crate::layouts::MOST_FRAMES;

/// A folder of calibrated pictures of a person. Pictures are read when they are asked for, by any number of threads at once.
#[derive(Debug, Clone)]
pub struct Capture {
    folder: PathBuf,
    found: Found,
}

impl Capture {
    /// Opens a folder; its layout is recognised by its files. Every frame's files are looked for, none is read.
    ///
    /// # Errors
    /// [`CaptureError`] that names the file and the field: a folder of no known layout, a calibration that is damaged or impossible, a camera
    /// without pictures, a missing frame or mask, a motion of another length.
    pub fn open(folder: &Path) -> Result<Self, CaptureError> {
        Ok(Self {
            folder: folder.to_owned(),
            found: layouts::read(folder)?,
        })
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The cameras as they took the pictures, distortion included; [`Camera::undistorted`] is what a [`Photograph`] has.
    #[must_use]
    pub fn cameras(&self) -> &[Camera] {
        &self.found.cameras
    }

    /// How many frames each camera has; frames of all cameras are synchronous.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.found.numbers.len()
    }

    /// Frames a second.
    #[must_use]
    pub fn frame_rate(&self) -> f64 {
        self.found.frame_rate
    }

    /// Whether a camera has masks.
    #[must_use]
    pub fn has_masks(&self, camera: usize) -> bool {
        (self.found.pictures.get(camera)).is_some_and(|pictures| pictures.masks.is_some())
    }

    /// A camera's picture of a frame, undistorted, with its mask where there is one.
    ///
    /// # Errors
    /// No such camera or frame; a file that cannot be read, is damaged or has another size than the camera.
    pub fn photograph(&self, camera: usize, frame: usize) -> Result<Photograph, CaptureError> {
        let missing = || {
            CaptureError::Request(format!(
                "camera {camera}, frame {frame} was asked for, but the capture has {} cameras and {} frames",
                self.found.cameras.len(),
                self.found.numbers.len()
            ))
        };
        let (lens, pictures, number) = (self.found.cameras.get(camera))
            .zip(self.found.pictures.get(camera))
            .zip(self.found.numbers.get(frame))
            .map(|((lens, pictures), number)| (lens, pictures, *number))
            .ok_or_else(missing)?;
        let rgb = decode::read(&pictures.frames.path(number), lens.size, Channels::Colour)?;
        let mask = (pictures.masks.as_ref())
            .map(|masks| decode::read(&masks.path(number), lens.size, Channels::Grey))
            .transpose()?;
        lens.photograph(rgb, mask)
    }

    /// How the person stands in each frame, where that is known.
    #[must_use]
    pub fn poses(&self) -> Option<&[FramePose]> {
        self.found.poses.as_deref()
    }

    /// The basis of the poses' expressions, where it is known.
    #[must_use]
    pub fn expression_basis(&self) -> Option<&ExpressionBasis> {
        self.found.expression_basis.as_ref()
    }

    /// Places a camera elsewhere; the folder is changed by [`Self::rewrite`] alone.
    ///
    /// # Errors
    /// No such camera, or a pose that [`Camera::check`] refuses.
    pub fn place(
        &mut self,
        camera: usize,
        camera_from_world: glam::DAffine3,
    ) -> Result<(), CaptureError> {
        let count = self.found.cameras.len();
        let Some(placed) = self.found.cameras.get_mut(camera) else {
            return Err(CaptureError::Request(format!(
                "camera {camera} is none of the capture's {count}"
            )));
        };
        placed.camera_from_world = camera_from_world;
        placed.check()
    }

    /// Writes the cameras as they are now, and other poses, into the folder, which must be in our own layout; pictures and masks stay as they are.
    ///
    /// # Errors
    /// Another layout; poses that are not one a frame or not finite; a file that cannot be written.
    pub fn rewrite(&mut self, poses: Vec<FramePose>) -> Result<(), CaptureError> {
        if !self.folder.join(layouts::MANIFEST).is_file() {
            return Err(CaptureError::Request(format!(
                "{} is another data set's folder, which is not written to: import it first",
                self.folder.display()
            )));
        }
        let found = &mut self.found;
        let manifest = layouts::manifest(
            &found.cameras,
            found.numbers.len(),
            found.frame_rate,
            &found.held_out,
        );
        writer::write_motion(
            &self.folder,
            &poses,
            found.numbers.len(),
            found.expression_basis.as_ref(),
        )?;
        writer::write_manifest(&self.folder, &manifest)?;
        found.poses = Some(poses);
        Ok(())
    }

    /// What is kept away from training.
    #[must_use]
    pub fn held_out(&self) -> &HeldOut {
        &self.found.held_out
    }

    /// What the reader decided or left out, one sentence each: axes, frames that a camera lacks, conventions that a data set does not state.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.found.notes
    }
}
