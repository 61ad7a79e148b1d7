//! A user's network for faces.

use super::decode::{Decoded, Look};
use super::network::Shared;
use super::plan::{EYES, HEAD, JAW};
use crate::TrackerError;
use crate::models::{FaceEstimate, FaceExpression, FaceHint, FaceModel, JointRotation};
use crate::picture::PictureView;
use motion_fit::landmarks::FaceLandmarks;

/// Landmarks of the mesh: the irises after them say nothing about a face's size.
const MESH: usize = 468;
/// Corners of the eyes away from the nose, the person's right one first.
const CORNERS: [usize; 2] = [33, 263];

pub(super) struct CustomFace {
    finder: Box<dyn FaceModel>,
    network: Shared,
}

impl CustomFace {
    pub(super) fn new(finder: Box<dyn FaceModel>, network: Shared) -> Self {
        Self { finder, network }
    }
}

impl FaceModel for CustomFace {
    /// Follows the finder's face only: where that is must first agree with the body.
    fn follow(&mut self, picture: PictureView<'_>) -> Result<Option<FaceEstimate>, TrackerError> {
        self.finder.follow(picture)
    }

    fn find(
        &mut self,
        picture: PictureView<'_>,
        hint: Option<&FaceHint>,
        followed: Option<FaceEstimate>,
    ) -> Result<Option<FaceEstimate>, TrackerError> {
        let found = self.finder.find(picture, hint, followed)?;
        let Some(found) = found.as_ref().and_then(FaceEstimate::landmarks) else {
            return Ok(None);
        };
        let [right, left] = CORNERS.map(|at| found.points[at].truncate());
        let across = left - right;
        let points = found.points.iter().take(MESH).map(|p| p.truncate());
        let region = self.network.region(points, across.y.atan2(across.x));
        let Some(region) = region else {
            return Ok(None);
        };
        let look = Look {
            region: &region,
            mirrored: false,
        };
        let Some(seen) = self.network.look(picture, look)? else {
            return Ok(None);
        };
        let landmarks = merged(found, &seen);
        let basis = self.network.plan.basis.clone();
        if basis.is_none() && seen.eyelids.is_none() && !seen.turns() {
            return Ok(Some(FaceEstimate::Landmarks(landmarks)));
        }
        let joint = |place: usize| {
            let joint = seen.joints.get(place).copied();
            joint.unwrap_or(JointRotation::UNKNOWN)
        };
        Ok(Some(FaceEstimate::Expression(Box::new(FaceExpression {
            basis,
            jaw: joint(JAW),
            eyes: EYES.map(joint),
            head: joint(HEAD),
            eyelids: seen.eyelids,
            confidence: seen.confidence,
            sight: self.network.sight(&region),
            landmarks: Some(landmarks),
            weights: seen.weights.unwrap_or_default(),
        }))))
    }
}

/// The network's landmarks where it has any, else those that were found.
fn merged(found: &FaceLandmarks, seen: &Decoded) -> FaceLandmarks {
    let mut face = found.clone();
    for (to, mark) in face.points.iter_mut().zip(&seen.marks) {
        if let Some(pixel) = mark.pixel {
            *to = pixel.extend(mark.depth.unwrap_or(to.z));
        }
    }
    face
}
