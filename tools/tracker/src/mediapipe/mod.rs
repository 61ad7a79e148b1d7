//! MediaPipe's networks for a body, hands and a face, and how its holistic graph finds where to look
//! (<https://github.com/google-ai-edge/mediapipe>, `mediapipe/modules`, Apache-2.0).

mod blaze_pose;
mod body;
mod detector;
mod face;
mod face_mesh;
mod hands;
mod mask;
mod one_euro;
mod regions;
mod seen;

pub use blaze_pose::{BodyBy, UnknownBody};
pub use body::Body;
pub use detector::{Detection, Detector};
pub use face::Face;
pub use hands::Hands;
pub use mask::{Mask, PersonMask};

use crate::TrackerError;
use crate::models::{HandModels, Models};
use crate::networks::NetworkSet;
use npu_runtime::{Provider, Runtime};
use std::path::Path;

/// Where a network stops to believe in what it sees, 0..=1.
const SEEN: f32 = 0.5;

/// Whether `value` is above `limit`; no number is not.
fn exceeds(value: f32, limit: f32) -> bool {
    value > limit
}

/// Which of MediaPipe's networks track a person, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Which networks see the body's landmarks.
    pub body: BodyBy,
    /// Whether and how hands are looked at.
    pub hands: HandsBy,
    /// In every how manieth picture a hand or a face that is followed is searched again: 1 is what MediaPipe does.
    pub search_every: u32,
    /// What runs each network.
    pub provider: Provider,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            body: BodyBy::Full,
            hands: HandsBy::Each,
            search_every: 15,
            provider: Provider::Cpu { threads: 1 },
        }
    }
}

/// How hands are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandsBy {
    /// Not at all.
    None,
    /// The left one in a picture and the right one in the next.
    Alternating,
    /// Each by a thread of its own.
    Each,
}

impl Options {
    /// The files that the networks are in, without their ending.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let mut names = Body::names(self.body);
        if self.hands != HandsBy::None {
            names.extend(Hands::NAMES);
        }
        names.extend(Face::NAMES);
        names
    }

    /// Loads the networks from the files in `folder`.
    ///
    /// # Errors
    /// [`TrackerError::Missing`] if the folder lacks one, and those of [`Network::open`](crate::networks::Network::open).
    pub fn load(&self, folder: &Path, runtime: &Runtime) -> Result<Models, TrackerError> {
        let set = NetworkSet::open(folder, &self.names(), runtime)?;
        let hands = || Hands::open(&set, self.search_every, self.provider).map(Box::new);
        Ok(Models {
            body: Box::new(Body::open(&set, self.body, self.provider)?),
            hands: match self.hands {
                HandsBy::None => HandModels::None,
                HandsBy::Alternating => HandModels::Alternating(hands()?),
                HandsBy::Each => HandModels::Each([hands()?, hands()?]),
            },
            face: Some(Box::new(Face::open(
                &set,
                self.search_every,
                self.provider,
            )?)),
        })
    }
}
