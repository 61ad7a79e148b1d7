//! The networks that look at pictures of a scan: one picture at a time, none followed from the one before.

use crate::RigError;
use crate::sight::Rgb;
use motion_fit::landmarks::{BodyLandmarks, FaceLandmarks};
use npu_runtime::{Provider, Runtime};
use std::path::Path;
use tracker::mediapipe::{Body, BodyBy, Face};
use tracker::models::{BodyEstimate, BodyModel, FaceEstimate, FaceModel};
use tracker::networks::NetworkSet;

/// Threads for each network: pictures of a scan are looked at one after the other.
const THREADS: usize = 2;

/// Networks for bodies and faces.
#[derive(Debug)]
pub struct Networks {
    body: Body,
    face: Face,
}

impl Networks {
    /// Loads them from a folder; without one, from the folder that the environment names.
    ///
    /// # Errors
    /// [`RigError::Tracker`] if a file is missing or damaged, [`RigError::Runtime`] if there is no ONNX Runtime.
    pub fn open(folder: Option<&Path>) -> Result<Self, RigError> {
        let folder = match folder {
            Some(folder) => folder.to_path_buf(),
            None => NetworkSet::folder_of_environment()?,
        };
        let runtime = Runtime::open(None)?;
        let mut names = Body::names(BodyBy::Full);
        names.extend(Face::NAMES);
        let set = NetworkSet::open(&folder, &names, &runtime)?;
        Ok(Self {
            body: Body::open(&set, BodyBy::Full, Provider::Cpu { threads: THREADS })?,
            face: Face::open(&set, 1, Provider::Cpu { threads: THREADS })?,
        })
    }

    /// The body in a picture, with its landmarks in pixels; nothing if there is none. Searched in the whole picture, then looked at
    /// again where it was found.
    ///
    /// # Errors
    /// [`RigError::Tracker`] if a network fails.
    pub fn body(&mut self, picture: &Rgb) -> Result<Option<BodyLandmarks>, RigError> {
        self.body.forget();
        Ok(match self.body.run(picture.view()?, 0.0)? {
            Some(BodyEstimate::Landmarks(seen)) => Some(seen),
            _ => None,
        })
    }

    /// How many people the last picture that [`Self::body`] looked at shows.
    #[must_use]
    pub fn people(&self) -> usize {
        self.body.people().unwrap_or(0)
    }

    /// The face in a picture; nothing if there is none.
    ///
    /// # Errors
    /// [`RigError::Tracker`] if a network fails.
    pub fn face(&mut self, picture: &Rgb) -> Result<Option<FaceLandmarks>, RigError> {
        self.face.forget();
        Ok(match self.face.find(picture.view()?, None, None)? {
            Some(FaceEstimate::Landmarks(seen)) => Some(seen),
            _ => None,
        })
    }
}
