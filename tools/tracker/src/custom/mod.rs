//! Networks that the user supplies, each an ONNX file with a TOML that describes it: `docs/models.md`.
//!
//! The default networks find body, hands and face; a user's network then looks at the region about what they found, and what it says
//! takes the place of theirs. What it does not say (landmarks beside rotations, a gaze) stays theirs.

mod body;
mod decode;
mod description;
mod face;
mod graph;
mod hand;
mod network;
mod orders;
mod plan;

use crate::TrackerError;
use crate::models::{BodyModel, FaceModel, HandModels, Models};
use network::Shared;
use npu_runtime::{Provider, Runtime};
use orders::Part;
use std::path::{Path, PathBuf};

/// Which of the default networks the user's take the places of. Each file is a network (`FILE.onnx`, with `FILE.toml` beside it) or a
/// description (`FILE.toml`, which names the network, or else has `FILE.onnx` beside it).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// For the body.
    pub body: Option<PathBuf>,
    /// For the hands.
    pub hand: Option<PathBuf>,
    /// For the face.
    pub face: Option<PathBuf>,
    /// What runs each network.
    pub provider: Provider,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            body: None,
            hand: None,
            face: None,
            provider: Provider::Cpu { threads: 1 },
        }
    }
}

impl Options {
    /// Puts the user's networks over `models`, which find body, hands and face for them.
    ///
    /// # Errors
    /// [`TrackerError::Description`] if a network or its description cannot be read, they do not fit each other, or `models` has nothing
    /// that finds its part; [`TrackerError::Custom`] if the runtime refuses it.
    pub fn load(&self, models: Models, runtime: &Runtime) -> Result<Models, TrackerError> {
        let provider = self.provider;
        let body = match &self.body {
            Some(path) => body(path, models.body, runtime, provider)?,
            None => models.body,
        };
        let hands = match &self.hand {
            Some(path) => hands(path, models.hands, runtime, provider)?,
            None => models.hands,
        };
        let face = match (&self.face, models.face) {
            (Some(path), Some(finder)) => Some(face(path, finder, runtime, provider)?),
            (Some(path), None) => return Err(unfound(path, "the face")),
            (None, face) => face,
        };
        Ok(Models { body, hands, face })
    }
}

/// The network at `path` for bodies that `finder` finds.
///
/// # Errors
/// As [`Options::load`].
pub fn body(
    path: &Path,
    finder: Box<dyn BodyModel>,
    runtime: &Runtime,
    provider: Provider,
) -> Result<Box<dyn BodyModel>, TrackerError> {
    let network = Shared::open(path, Part::Body, runtime, provider)?;
    Ok(Box::new(body::CustomBody::new(finder, network)))
}

/// The network at `path` for hands that `finders` find. It is loaded once: models for one hand each use it one after the other.
///
/// # Errors
/// As [`Options::load`].
pub fn hands(
    path: &Path,
    finders: HandModels,
    runtime: &Runtime,
    provider: Provider,
) -> Result<HandModels, TrackerError> {
    if matches!(finders, HandModels::None) {
        return Err(unfound(path, "hands"));
    }
    let network = Shared::open(path, Part::Hand, runtime, provider)?;
    let over = |finder| Box::new(hand::CustomHand::new(finder, network.clone()));
    Ok(match finders {
        HandModels::None => HandModels::None,
        HandModels::Alternating(finder) => HandModels::Alternating(over(finder)),
        HandModels::Each([left, right]) => HandModels::Each([over(left), over(right)]),
    })
}

/// The network at `path` for faces that `finder` finds.
///
/// # Errors
/// As [`Options::load`].
pub fn face(
    path: &Path,
    finder: Box<dyn FaceModel>,
    runtime: &Runtime,
    provider: Provider,
) -> Result<Box<dyn FaceModel>, TrackerError> {
    let network = Shared::open(path, Part::Face, runtime, provider)?;
    Ok(Box::new(face::CustomFace::new(finder, network)))
}

fn unfound(path: &Path, what: &str) -> TrackerError {
    TrackerError::Description {
        path: path.to_path_buf(),
        reason: format!("{what} must be found by the default networks first, and these are off"),
    }
}
